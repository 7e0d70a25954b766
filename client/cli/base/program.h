// Runs other programs without a shell.
#pragma once

#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "marble/error.h"

namespace marble::cli {

/// Conditions that end a running program. With either, it runs in its own process group, which is killed as a
/// whole.
struct ProgramLimits {
  std::optional<double> seconds;  ///< after its start
  std::stop_token stop;           ///< Ctrl-C
};

struct ProgramEnd {
  bool well = false;    ///< it exited with 0
  bool killed = false;  ///< because of a limit
  std::string out, err;
};

/// Runs words[0], found by PATH, to its end. Errors: not_found if there is no such program, internal if the
/// system lacks resources for it.
[[nodiscard]] Expected<ProgramEnd> run_program(const std::vector<std::string>& words,
                                               const std::string& input, const ProgramLimits& limits = {});

}  // namespace marble::cli
