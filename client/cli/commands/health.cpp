#include <iostream>
#include <nlohmann/json.hpp>

#include "arguments/server_arguments.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "output/json.h"

namespace marble::cli {
namespace {

int run(const ServerArguments& arguments) {
  const auto client = connect(arguments);
  if (!client) return server_fails(arguments, client.error());
  const auto healthy = client->healthy();
  if (!healthy) return server_fails(arguments, healthy.error());
  const char* state = *healthy ? "serving" : "not_serving";
  if (arguments.json()) {
    std::cout << line({{"server", arguments.server}, {"status", state}}) << '\n';
  } else {
    std::cout << state << '\n';
  }
  return *healthy ? kAllSolved : kUnreachable;
}

}  // namespace

void add_health(CLI::App& program, int& exit_code) {
  CLI::App* command = program.add_subcommand(
      "health", "Check whether a server accepts jobs: exits with 0 if it does, with 3 if not");
  command->callback(
      [arguments = add_server_arguments(*command), &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
