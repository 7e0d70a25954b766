// The configuration's TOML file.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"

namespace marble::server {

/// Sets what the file says in `config` and adds what is wrong with it to `faults`, line by line.
void read_config_file(const std::string& path, Config& config, std::vector<ConfigFault>& faults);

/// The same of a text that is read already; faults say that they are of `path`.
void read_config_text(std::string_view text, const std::string& path, Config& config,
                      std::vector<ConfigFault>& faults);

}  // namespace marble::server
