#include "marble/options.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "exit_code.h"

namespace marble::cli {
namespace {

std::string shown(const OptionInfo& option, double value) {
  switch (option.type) {
    case OptionType::choice:
      return std::string(option.choices[static_cast<std::size_t>(value)]);
    case OptionType::boolean:
      return value != 0.0 ? "true" : "false";
    case OptionType::integer:
      return std::to_string(static_cast<std::int64_t>(value));
    case OptionType::real:
      break;
  }
  return nlohmann::json(value).dump();
}

std::string range(const OptionInfo& option) {
  if (option.type == OptionType::boolean) return "true, false";
  if (option.type != OptionType::choice) {
    return "[" + shown(option, option.low) + ", " + shown(option, option.high) + "]";
  }
  std::string names;
  for (const std::string_view choice : option.choices)
    names += (names.empty() ? "" : ", ") + std::string(choice);
  return names;
}

int run() {
  for (const OptionInfo& option : option_table()) {
    const std::string unit = option.unit.empty() ? "" : " " + std::string(option.unit);
    std::printf("%-26s %-8s in %s%s\n    %s\n", std::string(option.name).c_str(),
                shown(option, option.default_value).c_str(), range(option).c_str(), unit.c_str(),
                std::string(option.doc).c_str());
  }
  return kAllSolved;
}

}  // namespace

void add_options(CLI::App& program, int& exit_code) {
  CLI::App* command = program.add_subcommand("options", "List the solver options with default and range");
  command->callback([&exit_code] { exit_code = run(); });
}

}  // namespace marble::cli
