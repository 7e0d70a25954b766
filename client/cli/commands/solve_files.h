// Solving files one after the other, wherever that is done.
#pragma once

#include <functional>
#include <string>

#include "arguments/solve_arguments.h"
#include "marble/problem_file.h"
#include "output/report.h"

namespace marble::cli {

/// How a file becomes a problem, and a problem an answer.
struct SolveMeans {
  std::function<Expected<ProblemFile>(const std::string& path)> read;
  std::function<Expected<Answer>(const OwnedProblem&, const Options&, const SolveControls&)> solve;
  bool remote = false;  ///< errors of `solve` may be the server's
};

/// In this process. The solver's own contract: one that is stopped answers with its best iterate.
[[nodiscard]] Expected<Answer> solve_here(const OwnedProblem& problem, const Options& options,
                                          const SolveControls& controls);

/// Solves and tells of each; the exit code.
[[nodiscard]] int solve_files(const SolveArguments& arguments, const Options& options,
                              const SolveMeans& means);

}  // namespace marble::cli
