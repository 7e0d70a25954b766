// A configuration read again while the server runs.
#pragma once

#include "access/access.h"
#include "config/config.h"
#include "log/log.h"

namespace marble::server {

/// Lets the log write what the configuration, which is valid, says of it.
void configure(Log& log, const Settings& settings);

class Reloader {
 public:
  /// `started` is what the server started with, and is in force.
  Reloader(CommandLine command_line, Config started, Access& access, Log& log)
      : command_line_(std::move(command_line)), in_force_(std::move(started)), access_(access), log_(log) {}

  /// Reads the configuration again and puts in force what can change at run time: tokens, quotas, roles and
  /// what is logged. Warns of the rest. One that has faults, or would let everybody in where callers were
  /// told apart, changes nothing.
  void reload();

 private:
  const CommandLine command_line_;
  Config in_force_;
  Access& access_;
  Log& log_;
};

}  // namespace marble::server
