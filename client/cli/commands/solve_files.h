// Solves files one after the other, in process or on a server.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "arguments/solve_arguments.h"
#include "marble/problem_file.h"
#include "output/problem_names.h"
#include "output/report.h"

namespace marble::cli {

/// How to read a file as a problem, and how to solve it.
struct SolveMeans {
  std::function<Expected<ProblemFile>(const std::string& path)> read;
  std::function<Expected<Answer>(const OwnedProblem&, const Options&, const SolveControls&)> solve;
  bool remote = false;  ///< errors of `solve` may be the server's
  /// The file's names of its parts, for a conflict; may be empty.
  std::function<Expected<ProblemNames>(const std::string& path, const OwnedProblem&)> names = {};
  /// For a file that `read` rejects: solves and reports it and returns the exit code, or returns nothing.
  std::function<std::optional<int>(const std::string& path, std::stop_token stop)> otherwise = {};
};

/// Solves in this process, by the solver's own contract: a stopped solve returns its best iterate.
[[nodiscard]] Expected<Answer> solve_locally(const OwnedProblem& problem, const Options& options,
                                             const SolveControls& controls);

/// Reports a file without a solution; returns the exit code. `remote`: the error may be the server's.
int report_error(const SolveArguments& arguments, const std::string& file, const std::string& name,
                 const Error& error, bool remote);

/// Solves and reports each file; returns the exit code.
[[nodiscard]] int solve_files(const SolveArguments& arguments, const Options& options,
                              const SolveMeans& means);

}  // namespace marble::cli
