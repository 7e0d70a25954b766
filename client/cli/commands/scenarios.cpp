// Computes one plan for many scenarios and prints each sample-average stage.
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>

#include "arguments/server_arguments.h"
#include "arguments/solver_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "commands/scenario_files.h"
#include "formats.h"
#include "output/json.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

struct ScenarioArguments {
  std::string base, samples, sampler, first_stage;
  ServerArguments server;
  SolverArguments solver;
  ScenarioSettings settings;
  Priority priority = Priority::by_method;
};

int file_fails(const std::string& path, const Error& error) {
  complain(path, error.message());
  return exit_code_of_local(error);
}

Json out_of_sample_json(const OutOfSample& out_of_sample) {
  return {{"scenarios", out_of_sample.scenarios},
          {"infeasible", out_of_sample.infeasible},
          {"mean", out_of_sample.mean},
          {"half_width", std::isfinite(out_of_sample.half_width) ? Json(out_of_sample.half_width) : Json()},
          {"factorizations", out_of_sample.factorizations}};
}

Json stage_json(const SampleAverageStage& stage) {
  return {{"stage", stage.stage},
          {"scenarios", stage.scenarios},
          {"status", to_string(stage.status)},
          {"objective", stage.objective},
          {"factorizations", stage.factorizations},
          {"seconds", stage.seconds},
          {"warm", stage.warm},
          {"searched", stage.searched},
          {"out_of_sample", stage.out_of_sample ? out_of_sample_json(*stage.out_of_sample) : Json()}};
}

void report_stage(const ScenarioArguments& arguments, const SampleAverageStage& stage) {
  if (arguments.server.json()) {
    std::cout << line(stage_json(stage)) << '\n' << std::flush;
    return;
  }
  if (stage.stage == 0)
    std::printf("%7s %-14s %15s %31s %9s %8s %8s\n", "scenarios", "status", "value",
                "in other scenarios, 95 %", "no way", "fact", "s");
  std::string others, no_way;
  if (stage.out_of_sample) {
    char text[64];
    std::snprintf(text, sizeof text, "%.7g +- %.3g", stage.out_of_sample->mean,
                  stage.out_of_sample->half_width);
    others = text;
    no_way = std::to_string(stage.out_of_sample->infeasible) + "/" +
             std::to_string(stage.out_of_sample->scenarios);
  }
  std::printf("%7lld %-14s %15.7e %31s %9s %8lld %8.3f\n", static_cast<long long>(stage.scenarios),
              to_string(stage.status), stage.objective, others.c_str(), no_way.c_str(),
              static_cast<long long>(stage.factorizations), stage.seconds);
  std::fflush(stdout);
}

void report_answer(const ScenarioArguments& arguments, const RemoteScenarios& answer) {
  if (arguments.server.json()) {
    std::cout << line({{"file", arguments.base},
                       {"job_id", answer.job_id},
                       {"end", to_string(answer.end)},
                       {"status", to_string(answer.status)},
                       {"detail", answer.detail},
                       {"scenarios", answer.scenarios},
                       {"objective", answer.scenarios > 0 ? Json(answer.objective) : Json()},
                       {"infeasible", answer.infeasible},
                       {"factorizations", answer.solution.factorizations},
                       {"x", answer.x}})
              << '\n'
              << std::flush;
    return;
  }
  std::printf(
      "%s: %s; the plan is for %lld scenarios, objective %.10g, largest violation %.1e\n%s\n",
      to_string(answer.end), to_string(answer.status), static_cast<long long>(answer.scenarios),
      answer.objective,
      std::max({answer.violations.equality, answer.violations.inequality, answer.violations.complementarity}),
      without_controls(answer.detail).c_str());
}

int run(ScenarioArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  arguments.settings.options = *options;
  const auto base = formats::read_any_problem(arguments.base);
  if (!base) return file_fails(arguments.base, base.error());
  const bool sampled = !arguments.sampler.empty();
  const std::string& scenarios = sampled ? arguments.sampler : arguments.samples;
  ScenarioFile file;
  auto read = sampled ? read_sampler(scenarios, file) : read_samples(scenarios, file);
  if (!read) return file_fails(scenarios, read.error());
  if (!arguments.first_stage.empty()) {
    auto plan = parse_indices(arguments.first_stage);
    if (!plan) return option_fails(plan.error());
    file.first_stage = *std::move(plan);
  }
  ScenarioProblem problem;
  problem.base = base->problem.view();
  problem.first_stage = file.first_stage;
  problem.own_equalities = file.own_equalities;
  problem.own_inequalities = file.own_inequalities;
  problem.own_pairs = file.own_pairs;
  const auto set = sampled ? set_scenarios(problem, file.sampler) : set_scenarios(problem, file.table);
  if (!set) return file_fails(scenarios, set.error());
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  arguments.settings.stage = [&](const SampleAverageStage& stage) { report_stage(arguments, stage); };
  CallControls call;
  call.problem_name = base->problem.name;
  call.priority = arguments.priority;
  const SolveControls controls{.stop = interrupt.token()};
  const auto answer = sampled
                          ? client->solve_scenarios(problem, file.sampler, arguments.settings, controls, call)
                          : client->solve_scenarios(problem, arguments.settings, controls, call);
  if (!answer) return server_fails(arguments.server, answer.error());
  report_answer(arguments, *answer);
  return is_solved(answer->status) ? kAllSolved : kNotSolved;
}

}  // namespace

void add_scenarios(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<ScenarioArguments>();
  CLI::App* command = program.add_subcommand(
      "scenarios", "Solve a two-stage stochastic LCQP by sample average approximation");
  command
      ->add_option("FILE", arguments->base,
                   "base problem, over the first-stage variables and the recourse variables of one scenario")
      ->required();
  auto* samples =
      command->add_option("--samples", arguments->samples,
                          ".npz file with one row per scenario for each part that varies (c0, g, b, d, l, r, "
                          "or the values of Q, A, C, L, R), and optionally weights and first_stage");
  command
      ->add_option("--sampler", arguments->sampler,
                   "JSON file that describes the random numbers and the data they change; the solver draws "
                   "the scenarios")
      ->excludes(samples);
  command->add_option("--first-stage", arguments->first_stage,
                      "first-stage variables, such as 0-3,7; needed where the file does not name them");
  add_server_arguments(*command, arguments->server);
  add_priority_argument(*command, arguments->priority);
  add_solver_arguments(*command, arguments->solver);
  ScenarioSettings& settings = arguments->settings;
  command
      ->add_option("--initial-sample-size", settings.initial_sample_size,
                   "number of scenarios of the first stage of the approximation")
      ->capture_default_str();
  command->add_option("--growth", settings.growth, "factor by which each stage has more scenarios")
      ->capture_default_str();
  command->add_option("--max-sample-size", settings.max_sample_size, "largest number of scenarios")
      ->capture_default_str();
  command
      ->add_option("--tolerance", settings.tolerance,
                   "stop when the 95 % confidence interval of the out-of-sample cost is at most this "
                   "fraction of the cost; 0: never")
      ->capture_default_str();
  command
      ->add_option("--min-sample-size", settings.min_sample_size,
                   "smallest number of scenarios at which --tolerance may stop")
      ->capture_default_str();
  command
      ->add_option("--out-of-sample-scenarios", settings.out_of_sample_scenarios,
                   "number of out-of-sample scenarios that evaluate a plan")
      ->capture_default_str();
  command->footer(kExitCodes);
  command->callback([arguments, &exit_code] {
    if (arguments->samples.empty() && arguments->sampler.empty())
      throw CLI::RequiredError("--samples or --sampler");
    exit_code = run(*arguments);
  });
}

}  // namespace marble::cli
