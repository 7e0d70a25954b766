// Other programs, run without a shell.
#pragma once

#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "marble/error.h"

namespace marble::cli {

/// When a program is ended that has not ended by itself. With either it runs in a process group of its own,
/// which is killed as a whole.
struct ProgramLimits {
  std::optional<double> seconds;  ///< after its start
  std::stop_token stop;           ///< Ctrl-C
};

struct ProgramEnd {
  bool well = false;    ///< it exited with 0
  bool killed = false;  ///< for a limit
  std::string out, err;
};

/// Runs words[0], found by PATH, to its end. Errors: not_found if there is no such program, internal if the
/// system has no place for it.
[[nodiscard]] Expected<ProgramEnd> run_program(const std::vector<std::string>& words,
                                               const std::string& input, const ProgramLimits& limits = {});

}  // namespace marble::cli
