// Which lines are logged: a level for each component.
#pragma once

#include <spdlog/common.h>

#include <array>
#include <cstddef>
#include <string>

#include "marble/error.h"

namespace marble::server {

/// The subject of a log line.
enum class Component {
  server,     ///< start, stop, drain, reload
  config,     ///< errors in a configuration read again
  tls,        ///< certificates
  access,     ///< callers who are unknown, or lack a role
  admission,  ///< requests that did not become jobs
  job,        ///< one line per solve
  session,    ///< open, end; at debug one line per update
  http,       ///< the HTTP port
  grpc,       ///< messages of gRPC itself
};
constexpr std::array<const char*, 9> kComponentNames = {"server", "config",  "tls",  "access", "admission",
                                                        "job",    "session", "http", "grpc"};
[[nodiscard]] constexpr const char* to_string(Component component) {
  return kComponentNames[static_cast<std::size_t>(component)];
}

using LogLevel = spdlog::level::level_enum;

/// The lowest level that is logged, by component.
using LogLevels = std::array<LogLevel, kComponentNames.size()>;

/// Returns `level` for all components, except those in `overrides`: "session=debug,access=warn". Errors:
/// invalid_argument, field "log_levels", with the invalid part.
[[nodiscard]] Expected<LogLevels> log_levels_of(const std::string& level, const std::string& overrides);

}  // namespace marble::server
