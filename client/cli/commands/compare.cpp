#include <memory>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "research/comparison_arguments.h"

namespace marble::cli {
namespace {

struct CompareArguments : ComparisonArguments {
  std::vector<std::string> files;
};

int run(const CompareArguments& arguments) {
  const auto contestants = contestants_of(arguments, {"marble"});
  if (!contestants) return option_fails(contestants.error());
  const auto problems = read_all(arguments.files);
  if (!problems) {
    complain(problems.error().message());
    return kBadInput;
  }
  return compare_and_report(arguments, *problems, *contestants, "performance profile");
}

}  // namespace

void add_compare(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<CompareArguments>();
  CLI::App* command = program.add_subcommand(
      "compare",
      "Solve problems with several options and other programs, and judge all results by the same checks");
  command->add_option("FILE", arguments->files, "problems in any format")->required();
  add_comparison_arguments(*command, *arguments);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
