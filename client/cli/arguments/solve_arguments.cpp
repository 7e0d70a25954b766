#include "arguments/solve_arguments.h"

#include "base/exit_code.h"

namespace marble::cli {

namespace {

void add_common(CLI::App& command, SolveArguments& arguments) {
  command
      .add_option("FILE", arguments.files,
                  "a problem file: .json, .pb, .bin, .npz, .nl or a folder; - is standard input")
      ->required();
  add_server_arguments(command, arguments.server);
  add_priority_argument(command, arguments.priority);
  command.add_flag("--local", arguments.local, "solve in this process, without a server")
      ->excludes(command.get_option("--server"));
  add_solver_arguments(command, arguments.solver);
}

}  // namespace

CLI::App* add_explain_command(CLI::App& program, const std::shared_ptr<SolveArguments>& arguments) {
  CLI::App* command = program.add_subcommand(
      "explain", "Name a smallest set of rows and pairs that makes a problem infeasible");
  arguments->explains = true;
  add_common(*command, *arguments);
  command->add_flag("--quiet", arguments->quiet, "no iteration table");
  command->footer(
      "The objective is left out. Rows, pairs and variables are named as the file names them: by \"names\" "
      "in\n"
      "JSON, by the .row and .col files beside an .nl file, else by their numbers from 0. --time-limit ends "
      "the\n"
      "search with the smallest set so far.\n"
      "Exit codes: 0 each conflict was named, 1 some problem has a point or was not proved infeasible, 2 "
      "usage or\n"
      "bad file, 3 server unreachable or refused; of several outcomes the highest.");
  return command;
}

CLI::App* add_solve_command(CLI::App& program, const std::shared_ptr<SolveArguments>& arguments) {
  CLI::App* command = program.add_subcommand("solve", "Solve problem files, in their order");
  add_common(*command, *arguments);
  command->add_option("--trace", arguments->trace,
                      "write every iteration to this file, as CSV; for one FILE (see: marble plot)");
  command->add_option("--sensitivity", arguments->sensitivity,
                      "derivatives to return with each answer: a JSON file of directions, losses and rows");
  command->add_option(
      "--bundle", arguments->bundle,
      "write problem, options, convergence and answer to this .tar.zst file, for a bug report; for "
      "one FILE (see: marble replay)");
  command->add_option(
      "--proof", arguments->proof,
      "write what proves the bound, or that no point is feasible, to this file, for one FILE solved in this "
      "process (see: python3 -m marble.proof.check_proof)");
  command->add_flag("--quiet", arguments->quiet, "no iteration table");
  command->footer(
      std::string("The iteration table goes to standard error, answers to standard output.\n"
                  "Ctrl-C stops the solve: a local one answers with its best iterate, a remote one is given "
                  "up.\n") +
      kExitCodes);
  return command;
}

}  // namespace marble::cli
