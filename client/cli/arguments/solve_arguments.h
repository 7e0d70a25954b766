// Provides the arguments of `marble solve`.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "arguments/server_arguments.h"
#include "arguments/solver_arguments.h"
#include "marble/contract.h"

namespace marble::cli {

struct SolveArguments {
  std::vector<std::string> files;
  ServerArguments server;
  SolverArguments solver;
  Priority priority = Priority::by_method;
  bool local = false;
  bool quiet = false;
  std::string trace;        // empty: none is written
  std::string sensitivity;  // empty: no derivatives are requested
  std::string bundle;       // empty: none is written
  std::string proof;        // empty: none is written
  bool explains = false;    // as `marble explain`: rows and pairs matter, objectives do not
  [[nodiscard]] bool json() const { return server.json(); }
  /// True without a server.
  [[nodiscard]] bool here() const { return local || server.server == contract::local_address; }
};

/// Adds the subcommand `explain`, without an action.
[[nodiscard]] CLI::App* add_explain_command(CLI::App& program,
                                            const std::shared_ptr<SolveArguments>& arguments);

/// Adds the subcommand `solve`, without an action.
[[nodiscard]] CLI::App* add_solve_command(CLI::App& program,
                                          const std::shared_ptr<SolveArguments>& arguments);

}  // namespace marble::cli
