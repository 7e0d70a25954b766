#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "exit_code.h"
#include "server_arguments.h"

namespace marble::cli {
namespace {

int run(const ServerArguments& arguments) {
  const auto client = Client::connect(arguments.server);
  if (!client) return server_fails(arguments, client.error());
  const auto info = client->info();
  if (!info) return server_fails(arguments, info.error());
  const nlohmann::ordered_json json{{"server", arguments.server},
                                    {"version", info->version},
                                    {"workers", info->workers},
                                    {"uptime_s", info->uptime_s},
                                    {"message_bytes", info->message_bytes},
                                    {"queue_jobs", info->queue_jobs},
                                    {"queue_bytes", info->queue_bytes},
                                    {"queued", info->queued},
                                    {"running", info->running},
                                    {"accepted", info->accepted},
                                    {"answered", info->answered},
                                    {"solved", info->solved},
                                    {"refused", info->refused},
                                    {"cancelled", info->cancelled},
                                    {"failed", info->failed}};
  if (arguments.json()) {
    std::cout << json.dump() << '\n';
    return kAllSolved;
  }
  for (const auto& [key, value] : json.items()) {
    const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
    std::printf("%-14s %s\n", key.c_str(), text.c_str());
  }
  return kAllSolved;
}

}  // namespace

void add_info(CLI::App& program, int& exit_code) {
  CLI::App* command = program.add_subcommand("info", "Version, workers, limits and counters of a server");
  command->callback(
      [arguments = add_server_arguments(*command), &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
