// What all commands share that solve: the solver's options.
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

/// A warning on standard error for each option that was given and changes nothing beside the others.
void warn_of_idle_options(const SolverArguments& arguments, const Options& options);

/// Prints what is wrong with an option and returns the exit code for it.
[[nodiscard]] int option_fails(const Error& error);

}  // namespace marble::cli
