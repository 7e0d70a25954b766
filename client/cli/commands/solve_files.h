// Solving files one after the other, wherever that is done.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "arguments/solve_arguments.h"
#include "conflict/problem_names.h"
#include "marble/problem_file.h"
#include "output/report.h"

namespace marble::cli {

/// How a file becomes a problem, and a problem an answer.
struct SolveMeans {
  std::function<Expected<ProblemFile>(const std::string& path)> read;
  std::function<Expected<Answer>(const OwnedProblem&, const Options&, const SolveControls&)> solve;
  bool remote = false;  ///< errors of `solve` may be the server's
  /// What a file calls its parts, for a conflict; none where it is empty.
  std::function<Expected<ProblemNames>(const std::string& path, const OwnedProblem&)> names = {};
  /// For a file that `read` does not take: the outcome, once it is solved and told of, or nothing.
  std::function<std::optional<int>(const std::string& path, std::stop_token stop)> otherwise = {};
};

/// In this process. The solver's own contract: one that is stopped answers with its best iterate.
[[nodiscard]] Expected<Answer> solve_here(const OwnedProblem& problem, const Options& options,
                                          const SolveControls& controls);

/// Tells of a file without an answer; the exit code. `remote`: the error may be the server's.
int tell_error(const SolveArguments& arguments, const std::string& file, const std::string& name,
               const Error& error, bool remote);

/// Solves and tells of each; the exit code.
[[nodiscard]] int solve_files(const SolveArguments& arguments, const Options& options,
                              const SolveMeans& means);

}  // namespace marble::cli
