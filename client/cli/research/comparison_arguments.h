// Provides the common arguments of `compare` and `reproduce`, and their processing.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "arguments/solver_arguments.h"
#include "research/comparison.h"

namespace marble::cli {

struct ComparisonArguments {
  SolverArguments solver;
  std::vector<std::string> with, methods, peers, recorded;
  ComparisonSettings settings;
  std::string table, profile;  // files; empty: none is written
};

void add_comparison_arguments(CLI::App& command, ComparisonArguments& arguments);

/// Returns the requested contestants: those of --with and --methods, or `own` without either; then the peers.
[[nodiscard]] Expected<std::vector<Contestant>> contestants_of(const ComparisonArguments& arguments,
                                                               const std::vector<std::string>& own);

/// Reads all files, or reports which one cannot be read.
[[nodiscard]] Expected<std::vector<ProblemFile>> read_all(const std::vector<std::string>& paths);

/// Compares, prints and writes; returns the exit code.
[[nodiscard]] int compare_and_report(const ComparisonArguments& arguments,
                                     const std::vector<ProblemFile>& problems,
                                     const std::vector<Contestant>& contestants, const std::string& title);

}  // namespace marble::cli
