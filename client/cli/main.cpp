#include <csignal>

#include "commands.h"
#include "exit_code.h"
#include "marble/version.h"

int main(int argc, char** argv) {
  using namespace marble::cli;
  std::signal(SIGPIPE, SIG_DFL);
  CLI::App program(
      "Solves quadratic programs with complementarity constraints, on a Marble server or in process.",
      "marble");
  program.set_version_flag("--version", std::string("marble ") + marble::kVersion);
  program.require_subcommand(1);
  program.get_formatter()->column_width(36);
  program.footer(
      "Exit codes: 0 all solved, 1 some not solved, 2 usage or bad file, 3 server unreachable or refused.\n"
      "The server is --server ADDR, else MARBLE_SERVER, else 127.0.0.1:50051; unix:PATH works too.");
  int exit_code = kAllSolved;
  add_solve(program, exit_code);
  add_convert(program, exit_code);
  add_example(program, exit_code);
  add_health(program, exit_code);
  add_info(program, exit_code);
  add_options(program, exit_code);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : kBadInput;
  }
  return exit_code;
}
