// The program marble: solves JSON files in this process, and executes the program with all commands for
// everything else. Loading that program's libraries (gRPC, libzip, ncurses and their dependencies) takes
// longer than most solves.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <filesystem>
#include <optional>
#include <string_view>

#include "arguments/solve_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/solve_files.h"

namespace marble::cli {
namespace {

bool is_json_file(const std::string& path) {
  std::error_code failed;
  return path.ends_with(".json") && std::filesystem::is_regular_file(path, failed);
}

// Returns nothing if the other program must run: other commands, help, wrong usage, servers, other files.
std::optional<int> solve_json_locally(int argc, char** argv) {
  if (argc < 2 || std::string_view(argv[1]) != "solve") return std::nullopt;
  CLI::App program;
  const auto arguments = std::make_shared<SolveArguments>();
  static_cast<void>(add_solve_command(program, arguments));
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError&) {
    return std::nullopt;
  }
  if (!arguments->here() || !arguments->bundle.empty() ||
      !std::ranges::all_of(arguments->files, is_json_file))
    return std::nullopt;
  const auto options = parse_options(arguments->solver);
  if (!options) return option_fails(options.error());
  if (options->explain) return std::nullopt;  // files have names, which the other program reads
  return solve_files(*arguments, *options, {read_json_problem, solve_locally});
}

// Returns only on failure.
int hand_over(char** argv) {
  std::error_code failed;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", failed);
  const std::string program = (self.parent_path() / MARBLE_ALL_COMMANDS).lexically_normal().string();
  execv(program.c_str(), argv);
  complain(program, std::string("cannot be run: ") + std::strerror(errno));
  return kBadInput;
}

}  // namespace
}  // namespace marble::cli

int main(int argc, char** argv) {
  using namespace marble::cli;
  std::signal(SIGPIPE, SIG_DFL);  // so that `marble example hopper | head` ends quietly
  try {
    if (const auto exit_code = solve_json_locally(argc, argv)) return *exit_code;
  } catch (const std::exception& error) {
    complain(error.what());
    return kBadInput;
  }
  return hand_over(argv);
}
