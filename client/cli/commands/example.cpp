#include <iostream>
#include <memory>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "marble/examples.h"
#include "marble/problem_file.h"
#include "marble/published_examples.h"

namespace marble::cli {
namespace {

struct ExampleArguments {
  std::string name;
  int steps = 0;  // 0: the example's default
  std::uint64_t seed = 0;
  bool published = false;
};

template <class Parameters>
OwnedProblem generate(const ExampleArguments& arguments, OwnedProblem (*generator)(const Parameters&)) {
  Parameters parameters = examples::vary(Parameters{}, arguments.seed);
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
  return examples::qpec({}, arguments.seed);
}

int run(const ExampleArguments& arguments) {
  if (arguments.published && arguments.name == "qpec") {
    complain("--paper is for hopper, rocket and gates: the paper has no qpec");
    return kBadInput;
  }
  ProblemFile file;
  file.problem = problem(arguments);
  std::cout << write_problem(file, FileFormat::json) << std::flush;
  if (std::cout) return kAllSolved;
  complain("standard output cannot be written");
  return kBadInput;
}

}  // namespace

void add_example(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<ExampleArguments>();
  CLI::App* command = program.add_subcommand(
      "example", "Print one of the paper's robotics problems, or a random QPEC, as JSON");
  command->add_option("NAME", arguments->name, "hopper, rocket, gates or qpec")
      ->required()
      ->check(CLI::IsMember({"hopper", "rocket", "gates", "qpec"}));
  CLI::Option* const steps =
      command
          ->add_option("--steps", arguments->steps, "number of stages of the horizon; default 60, 40 or 30")
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
