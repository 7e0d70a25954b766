#include "marble/options.h"

#include <cstdio>
#include <memory>

#include "base/exit_code.h"
#include "base/option_text.h"
#include "commands/commands.h"

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

/// Prints a row of the table in core/OPTIONS.md.
void print_markdown(const OptionInfo& option) {
  std::string doc;
  for (const char c : option.doc) doc.append(c == '|' ? "\\|" : std::string(1, c));
  const std::string unit = option.unit.empty() ? "" : " " + std::string(option.unit);
  std::printf("| `%s` | %s%s | %s | %s |\n", std::string(option.name).c_str(),
              option_text(option, option.default_value).c_str(), unit.c_str(), range(option).c_str(),
              doc.c_str());
}

void print_text(const OptionInfo& option) {
  const std::string unit = option.unit.empty() ? "" : " " + std::string(option.unit);
  std::printf("%-26s %-8s in %s%s\n    %s\n", std::string(option.name).c_str(),
              option_text(option, option.default_value).c_str(), range(option).c_str(), unit.c_str(),
              std::string(option.doc).c_str());
}

void print(bool markdown, bool research) {
  if (markdown) std::printf("| option | default | range | meaning |\n| --- | --- | --- | --- |\n");
  for (const OptionInfo& option : option_table()) {
    if (option.research == research) markdown ? print_markdown(option) : print_text(option);
  }
}

int run(bool markdown) {
  print(markdown, false);
  std::printf(markdown ? "\n" : "\nfor research, with the algorithm of the paper or published methods:\n");
  print(markdown, true);
  return kAllSolved;
}

}  // namespace

void add_options(CLI::App& program, int& exit_code) {
  CLI::App* command = program.add_subcommand("options", "List the solver options with default and range");
  auto output = std::make_shared<std::string>("text");
  command->add_option("--output", *output, "text or markdown")
      ->check(CLI::IsMember({"text", "markdown"}))
      ->capture_default_str();
  command->callback([&exit_code, output] { exit_code = run(*output == "markdown"); });
}

}  // namespace marble::cli
