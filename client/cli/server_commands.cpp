#include <cinttypes>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "exit_code.h"
#include "marble/client.h"
#include "marble/options.h"

namespace marble::cli {
namespace {

struct ServerArguments {
  std::string server = default_server_address();
  std::string output = "text";
};

std::shared_ptr<ServerArguments> add_arguments(CLI::App& command) {
  auto arguments = std::make_shared<ServerArguments>();
  command.add_option("--server", arguments->server, "address of the server: host:port or unix:PATH")
      ->capture_default_str();
  command.add_option("--output", arguments->output, "text or json")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  return arguments;
}

int fail(const ServerArguments& arguments, const Error& error) {
  std::cerr << "marble: server " << arguments.server << ": " << error.message() << '\n';
  return kUnreachable;
}

int health(const ServerArguments& arguments) {
  const auto healthy = Client(arguments.server).healthy();
  if (!healthy) return fail(arguments, healthy.error());
  const char* state = *healthy ? "serving" : "not_serving";
  if (arguments.output == "json") {
    std::cout << nlohmann::ordered_json{{"server", arguments.server}, {"status", state}}.dump() << '\n';
  } else {
    std::cout << state << '\n';
  }
  return *healthy ? kAllSolved : kUnreachable;
}

int info(const ServerArguments& arguments) {
  const auto info = Client(arguments.server).info();
  if (!info) return fail(arguments, info.error());
  const std::pair<const char*, nlohmann::ordered_json> rows[] = {
      {"version", info->version},       {"workers", info->workers},
      {"uptime_s", info->uptime_s},     {"message_bytes", info->message_bytes},
      {"queue_jobs", info->queue_jobs}, {"queue_bytes", info->queue_bytes},
      {"queued", info->queued},         {"running", info->running},
      {"accepted", info->accepted},     {"answered", info->answered},
      {"solved", info->solved},         {"refused", info->refused},
      {"cancelled", info->cancelled}};
  nlohmann::ordered_json json{{"server", arguments.server}};
  for (const auto& [key, value] : rows) json[key] = value;
  if (arguments.output == "json") {
    std::cout << json.dump() << '\n';
  } else {
    for (const auto& [key, value] : json.items()) {
      std::printf("%-14s %s\n", key.c_str(),
                  value.is_string() ? value.get<std::string>().c_str() : value.dump().c_str());
    }
  }
  return kAllSolved;
}

void print_options() {
  const auto number = [](double value) { return nlohmann::json(value).dump(); };
  for (const OptionInfo& option : option_table()) {
    const auto show = [&](double value) {
      switch (option.type) {
        case OptionType::choice:
          return std::string(option.choices[static_cast<std::size_t>(value)]);
        case OptionType::boolean:
          return std::string(value != 0.0 ? "true" : "false");
        case OptionType::integer:
          return std::to_string(static_cast<std::int64_t>(value));
        case OptionType::real:
          break;
      }
      return number(value);
    };
    const bool ranged = option.type == OptionType::real || option.type == OptionType::integer;
    std::string range = ranged ? "[" + show(option.low) + ", " + show(option.high) + "]" : "true, false";
    if (option.type == OptionType::choice) {
      range.clear();
      for (const std::string_view choice : option.choices)
        range += (range.empty() ? "" : ", ") + std::string(choice);
    }
    std::printf("%s = %s   in %s%s%s\n    %s\n", std::string(option.name).c_str(),
                show(option.default_value).c_str(), range.c_str(), option.unit.empty() ? "" : " ",
                std::string(option.unit).c_str(), std::string(option.doc).c_str());
  }
}

}  // namespace

void add_health(CLI::App& program, int& exit_code) {
  CLI::App* command =
      program.add_subcommand("health", "Ask a server whether it takes jobs: exit 0 if it does, 3 if not");
  command->callback([arguments = add_arguments(*command), &exit_code] { exit_code = health(*arguments); });
}

void add_info(CLI::App& program, int& exit_code) {
  CLI::App* command = program.add_subcommand("info", "Version, workers, limits and counters of a server");
  command->callback([arguments = add_arguments(*command), &exit_code] { exit_code = info(*arguments); });
}

void add_options(CLI::App& program, int& exit_code) {
  CLI::App* command = program.add_subcommand("options", "List the solver options with default and range");
  command->callback([&exit_code] {
    print_options();
    exit_code = kAllSolved;
  });
}

}  // namespace marble::cli
