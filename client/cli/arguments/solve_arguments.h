// What `marble solve` is asked for.
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
  std::string sensitivity;  // empty: no derivatives are wanted
  std::string bundle;       // empty: none is written
  std::string proof;        // empty: none is written
  bool explains = false;    // as `marble explain`: rows and pairs count, objectives do not
  [[nodiscard]] bool json() const { return server.json(); }
  /// Without a server.
  [[nodiscard]] bool here() const { return local || server.server == contract::local_address; }
};

/// Adds the subcommand `explain`, which does nothing yet.
[[nodiscard]] CLI::App* add_explain_command(CLI::App& program,
                                            const std::shared_ptr<SolveArguments>& arguments);

/// Adds the subcommand `solve`, which does nothing yet.
[[nodiscard]] CLI::App* add_solve_command(CLI::App& program,
                                          const std::shared_ptr<SolveArguments>& arguments);

}  // namespace marble::cli
