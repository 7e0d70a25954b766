// The configuration's TOML file.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"

namespace marble::server {

/// Sets the file's values in `config` and appends its errors to `faults`, line by line.
void read_config_file(const std::string& path, Config& config, std::vector<ConfigFault>& faults);

/// Does the same for a text that is already read; errors name `path`.
void read_config_text(std::string_view text, const std::string& path, Config& config,
                      std::vector<ConfigFault>& faults);

}  // namespace marble::server
