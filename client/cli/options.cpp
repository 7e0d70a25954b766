#include "marble/options.h"

#include <cstdio>

#include "commands.h"
#include "exit_code.h"
#include "option_text.h"

namespace marble::cli {
namespace {

std::string range(const OptionInfo& option) {
  if (option.type == OptionType::boolean) return "true, false";
  if (option.type != OptionType::choice) {
    return "[" + option_text(option, option.low) + ", " + option_text(option, option.high) + "]";
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
                option_text(option, option.default_value).c_str(), range(option).c_str(), unit.c_str(),
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
