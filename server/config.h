// The server's configuration: one table (config.def) of settings, read from flags and the environment.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "marble/options.h"

namespace marble::server {

struct Config {
#define MARBLE_SETTING(type, name, default_value, low, high, unit, doc) type name = default_value;
#define MARBLE_TEXT_SETTING(name, default_value, choices, doc) std::string name = default_value;
#include "config.def"
#undef MARBLE_SETTING
#undef MARBLE_TEXT_SETTING
  Options solver_defaults;                                ///< of requests that leave an option out
  std::vector<std::string> listen = {"127.0.0.1:50051"};  ///< host:port, port 0 for a free one, or unix:PATH
};

/// Reads flags and environment. Where the process is to end instead (help, version, an error), prints why and
/// returns its exit code in `exit_code`.
std::optional<Config> read_config(int argc, char** argv, int& exit_code);

/// True if only this machine can reach the address: loopback, or a unix socket.
bool is_local_address(const std::string& address);

}  // namespace marble::server
