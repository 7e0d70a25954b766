// Which lines are logged: a level for each component.
#pragma once

#include <spdlog/common.h>

#include <array>
#include <cstddef>
#include <string>

#include "marble/error.h"

namespace marble::server {

/// What a log line is about.
enum class Component {
  server,     ///< start, stop, drain, reload
  config,     ///< what is wrong with a configuration read again
  tls,        ///< certificates
  access,     ///< callers who are not known, or lack a role
  admission,  ///< requests that did not become jobs
  job,        ///< a line a solve
  session,    ///< open, end; at debug a line an update
  http,       ///< the HTTP port
  grpc,       ///< what gRPC itself has to say
};
constexpr std::array<const char*, 9> kComponentNames = {"server", "config",  "tls",  "access", "admission",
                                                        "job",    "session", "http", "grpc"};
[[nodiscard]] constexpr const char* to_string(Component component) {
  return kComponentNames[static_cast<std::size_t>(component)];
}

using LogLevel = spdlog::level::level_enum;

/// The least level that is logged, by component.
using LogLevels = std::array<LogLevel, kComponentNames.size()>;

/// `level` for all, but for what `overrides` says otherwise: "session=debug,access=warn". Errors:
/// invalid_argument, field "log_levels", with the part that is wrong.
[[nodiscard]] Expected<LogLevels> log_levels_of(const std::string& level, const std::string& overrides);

}  // namespace marble::server
