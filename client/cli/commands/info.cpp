#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

#include "arguments/server_arguments.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "output/json.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

Json to_json(const ServerArguments& arguments, const ServerInfo& info) {
  Json json{{"server", arguments.server}, {"version", info.version}, {"client", info.client},
            {"roles", info.roles},        {"workers", info.workers}, {"uptime_s", info.uptime_s}};
#define MARBLE_LIMIT(type, name, field, doc) json[#name] = info.name;
#include "marble/server_info.def"
  if (info.quota) {
    json["quota"] = {{"running", info.quota->running},   {"queued", info.quota->queued},
                     {"sessions", info.quota->sessions}, {"bytes", info.quota->bytes},
                     {"watchers", info.quota->watchers}, {"priority", to_string(info.quota->priority)}};
  }
#define MARBLE_COUNTER(type, name, field, doc) json[#name] = info.name;
#include "marble/server_info.def"
  return json;
}

int print_info(const ServerArguments& arguments) {
  const auto client = connect(arguments);
  if (!client) return server_fails(arguments, client.error());
  const auto info = client->info();
  if (!info) return server_fails(arguments, info.error());
  const Json json = to_json(arguments, *info);
  if (arguments.json()) {
    std::cout << line(json) << '\n';
    return kAllSolved;
  }
  for (const auto& [key, value] : json.items()) {
    if (value.empty() || value == "") continue;  // the server does not report it
    const std::string text = without_controls(value.is_string() ? value.get<std::string>() : value.dump());
    std::printf("%-20s %s\n", key.c_str(), text.c_str());
  }
  return kAllSolved;
}

}  // namespace

void add_info(CLI::App& program, int& exit_code) {
  CLI::App* command =
      program.add_subcommand("info", "Print a server's version, workers, limits and counters");
  command->callback(
      [arguments = add_server_arguments(*command), &exit_code] { exit_code = print_info(*arguments); });
}

namespace {

int check_health(const ServerArguments& arguments) {
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
      [arguments = add_server_arguments(*command), &exit_code] { exit_code = check_health(*arguments); });
}

}  // namespace marble::cli
