// The configuration's TOML file.
#pragma once

#include <string>
#include <vector>

#include "config.h"

namespace marble::server {

/// Sets what the file says in `config` and adds what is wrong with it to `faults`, line by line.
void read_config_file(const std::string& path, Config& config, std::vector<ConfigFault>& faults);

}  // namespace marble::server
