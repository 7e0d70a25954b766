#include <iostream>
#include <memory>
#include <optional>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "marble/examples.h"
#include "marble/macmpec.h"
#include "marble/problem_file.h"
#include "marble/published_examples.h"
#include "output/text_table.h"

namespace marble::cli {
namespace {

struct ExampleArguments {
  std::string name;
  std::string problem;  // of macmpec
  int steps = 0;        // 0: the example's default
  std::uint64_t seed = 0;
  bool published = false;
};

template <class Parameters>
OwnedProblem generate(const ExampleArguments& arguments, OwnedProblem (*generator)(const Parameters&)) {
  Parameters parameters = examples::vary(Parameters{}, arguments.seed);
  if (arguments.steps > 0) parameters.steps = arguments.steps;
  return generator(parameters);
}

template <class Parameters>
OwnedProblem published(const ExampleArguments& arguments, OwnedProblem (*generator)(const Parameters&)) {
  Parameters parameters;
  if (arguments.steps > 0) parameters.steps = arguments.steps;
  return generator(parameters);
}

OwnedProblem problem(const ExampleArguments& arguments) {
  if (arguments.name == "hopper")
    return arguments.published ? examples::published_hopper() : generate(arguments, &examples::hopper);
  if (arguments.name == "rocket")
    return arguments.published ? examples::published_rocket() : generate(arguments, &examples::rocket);
  if (arguments.name == "gates")
    return arguments.published ? examples::published_gates() : generate(arguments, &examples::gates);
  if (arguments.name == "robots") return published(arguments, &examples::published_robots);
  if (arguments.name == "rocket3d") return published(arguments, &examples::published_rocket_3d);
  return examples::qpec({}, arguments.seed);
}

int fails(const std::string& message) {
  complain(message);
  return kBadInput;
}

int list_macmpec(const std::string& message) {
  TextTable table({"problem", "variables", "pairs", "optimum"});
  for (const examples::MacmpecProblem& each : examples::macmpec()) {
    const OwnedProblem problem = each.problem();
    table.add({std::string(each.name), std::to_string(problem.g.size()), std::to_string(problem.l.size()),
               formatted("%.12g", each.optimum)});
  }
  complain(message);
  std::cerr << table.text() << std::flush;
  return kBadInput;
}

int print(const ProblemFile& file) {
  std::cout << write_problem(file, FileFormat::json) << std::flush;
  return std::cout ? kAllSolved : fails("standard output cannot be written");
}

// The options that an example has not.
std::optional<std::string> refused(const ExampleArguments& arguments) {
  const std::string& name = arguments.name;
  const bool published = name == "robots" || name == "rocket3d";
  const bool varied = name == "hopper" || name == "rocket" || name == "gates";
  if (arguments.published && !varied) return "--paper is for hopper, rocket and gates";
  if (arguments.steps > 0 && !varied && !published)
    return "--steps is for hopper, rocket, gates, robots and rocket3d";
  if (arguments.seed != 0 && !varied && name != "qpec") return "--seed is for hopper, rocket, gates and qpec";
  if (!arguments.problem.empty() && name != "macmpec") return "PROBLEM is for macmpec";
  return std::nullopt;
}

int run(const ExampleArguments& arguments) {
  if (const auto message = refused(arguments)) return fails(*message);
  if (arguments.name != "macmpec") return print({problem(arguments), {}, false});
  if (arguments.problem.empty()) return list_macmpec("macmpec needs PROBLEM, one of these:");
  const examples::MacmpecProblem* const found = examples::find_macmpec(arguments.problem);
  if (found == nullptr)
    return list_macmpec("PROBLEM: \"" + arguments.problem + "\" is not a problem of macmpec. These are:");
  return print({found->problem(), found->optimum, false});
}

}  // namespace

void add_example(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<ExampleArguments>();
  CLI::App* command = program.add_subcommand(
      "example",
      "Print one of the paper's robotics problems, a random QPEC or a problem of MacMPEC, as JSON");
  command->add_option("NAME", arguments->name, "hopper, rocket, gates, robots, rocket3d, qpec or macmpec")
      ->required()
      ->check(CLI::IsMember({"hopper", "rocket", "gates", "robots", "rocket3d", "qpec", "macmpec"}));
  command->add_option("PROBLEM", arguments->problem,
                      "of macmpec, such as bard1; without it, the names are listed and the exit status is 2");
  CLI::Option* const steps = command
                                 ->add_option("--steps", arguments->steps,
                                              "number of stages of the horizon; default 60, 40, 30, 30 or 40")
                                 ->check(CLI::Range(2, 100000));
  CLI::Option* const seed =
      command
          ->add_option("--seed", arguments->seed, "seed of the problem's variation; 0 is the nominal problem")
          ->capture_default_str();
  command
      ->add_flag("--paper", arguments->published,
                 "with the parameters that the paper's authors published, of hopper, rocket or gates")
      ->excludes(steps)
      ->excludes(seed);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
