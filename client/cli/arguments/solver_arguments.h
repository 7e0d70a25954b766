// Provides the arguments of all commands that solve: the solver's options.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/options.h"

namespace marble::cli {

struct SolverArguments {
  std::vector<std::string> options;
  std::string time_limit_s;
};

void add_solver_arguments(CLI::App& command, SolverArguments& arguments);

[[nodiscard]] Expected<Options> parse_options(const SolverArguments& arguments);
/// The same for comparisons, which run every `method`.
[[nodiscard]] Expected<Options> parse_research_options(const SolverArguments& arguments);

/// Prints a warning on standard error for each given option that has no effect with the others.
void warn_of_idle_options(const SolverArguments& arguments, const Options& options);

/// Prints an option's error and returns its exit code.
[[nodiscard]] int option_fails(const Error& error);

}  // namespace marble::cli
