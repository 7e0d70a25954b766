// Reads the configuration again while the server runs.
#pragma once

#include "access/access.h"
#include "config/config.h"
#include "log/log.h"

namespace marble::server {

/// Applies the log settings of a valid configuration.
void configure(Log& log, const Settings& settings);

class Reloader {
 public:
  /// `started` is the configuration that the server started with and uses.
  Reloader(CommandLine command_line, Config started, Access& access, Log& log)
      : command_line_(std::move(command_line)), in_force_(std::move(started)), access_(access), log_(log) {}

  /// Reads the configuration again and applies what can change at run time: tokens, quotas, roles and log
  /// settings. Warns about the rest. A configuration with errors, or one that would accept all callers where
  /// they were identified before, changes nothing.
  void reload();

 private:
  const CommandLine command_line_;
  Config in_force_;
  Access& access_;
  Log& log_;
};

}  // namespace marble::server
