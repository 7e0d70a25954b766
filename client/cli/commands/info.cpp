#include <cstdio>
#include <iostream>

#include "arguments/server_arguments.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "output/json.h"

namespace marble::cli {
namespace {

Json to_json(const ServerArguments& arguments, const ServerInfo& info) {
  Json json{{"server", arguments.server},
            {"version", info.version},
            {"client", info.client},
            {"roles", info.roles},
            {"workers", info.workers},
            {"uptime_s", info.uptime_s},
            {"message_bytes", info.message_bytes},
            {"solve_bytes", info.solve_bytes},
            {"solve_seconds", info.solve_seconds},
            {"queue_jobs", info.queue_jobs},
            {"queue_bytes", info.queue_bytes},
            {"sessions_limit", info.sessions_limit},
            {"session_bytes_limit", info.session_bytes_limit},
            {"session_idle_s", info.session_idle_s},
            {"session_updates", info.session_updates},
            {"batch_window", info.batch_window},
            {"history_jobs", info.history_jobs},
            {"trace_rows", info.trace_rows},
            {"trace_pairs", info.trace_pairs},
            {"result_keep_s", info.result_keep_s},
            {"result_bytes_limit", info.result_bytes_limit}};
  if (info.quota) {
    json["quota"] = {{"running", info.quota->running},   {"queued", info.quota->queued},
                     {"sessions", info.quota->sessions}, {"bytes", info.quota->bytes},
                     {"watchers", info.quota->watchers}, {"priority", to_string(info.quota->priority)}};
  }
  json.update({{"queued", info.queued},
               {"running", info.running},
               {"accepted", info.accepted},
               {"answered", info.answered},
               {"solved", info.solved},
               {"refused", info.refused},
               {"cancelled", info.cancelled},
               {"failed", info.failed},
               {"sessions", info.sessions},
               {"session_bytes", info.session_bytes},
               {"sessions_opened", info.sessions_opened},
               {"updates", info.updates},
               {"updates_solved", info.updates_solved},
               {"result_bytes", info.result_bytes},
               {"request_bytes", info.request_bytes},
               {"resident_bytes", info.resident_bytes},
               {"busy_s", info.busy_s},
               {"cpu_s", info.cpu_s}});
  return json;
}

int run(const ServerArguments& arguments) {
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
    if (value.empty() || value == "") continue;  // the server does not say
    const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
    std::printf("%-20s %s\n", key.c_str(), text.c_str());
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
