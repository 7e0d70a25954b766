#include "marble/composite/scenarios.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "families.h"
#include "marble/scenario_examples.h"
#include "noise.h"

namespace marble::suite {
namespace {

using examples::OneNumberScenarios;

std::vector<double> draws(std::uint64_t seed, int scenarios, double low, double high) {
  Noise noise(seed);
  std::vector<double> result;
  for (int i = 0; i < scenarios; ++i) result.push_back(low + (high - low) * 0.5 * (1.0 + noise.uniform()));
  return result;
}

// Altitudes at the centres of N equal parts of 3 to 4.8 m, cold.
void optima(const OneNumberScenarios& rocket) {
  std::printf("rocket, one plan for N altitudes 3 + 1.8 (j + 1/2) / N m, cold\n");
  std::printf("%6s %10s %6s  %-10s %13s %15s %10s\n", "N", "variables", "pairs", "end", "objective",
              "factorizations", "CPU ms");
  for (const int scenarios : {1, 2, 4, 8, 16, 32}) {
    std::vector<double> altitudes;
    for (int j = 0; j < scenarios; ++j) altitudes.push_back(3.0 + 1.8 * (j + 0.5) / scenarios);
    const double begun = 1e3 * processor_seconds();
    const ScenarioSolution answer =
        solve_scenarios(
            rocket.scenarios(altitudes),
            {.initial_sample_size = scenarios, .max_sample_size = scenarios, .out_of_sample_scenarios = 0})
            .value();
    const SampleAverageStage& stage = answer.stages.back();
    std::printf("%6d %10d %6d  %-10s %13.6f %15lld %10.1f\n", scenarios, stage.variables, stage.pairs,
                to_string(answer.status), answer.objective, static_cast<long long>(stage.factorizations),
                1e3 * processor_seconds() - begun);
    std::fflush(stdout);
  }
  for (const double altitude : {4.8, 5.138, 5.392}) {
    const ScenarioSolution answer = solve_scenarios(rocket.scenarios({altitude})).value();
    std::printf("%6.3f m alone: %s %.6f\n", altitude, to_string(answer.status), answer.objective);
  }
  std::printf("\n");
}

struct Cold {
  Solution solution;
  double ms;
};

Cold solve_cold(const OwnedProblem& whole, const Options& options) {
  const double begun = 1e3 * processor_seconds();
  Solution solution = solve_in_process(whole.view(), options).value();
  return {std::move(solution), 1e3 * processor_seconds() - begun};
}

// 1 to 32 altitudes against 32 at once: cold by default, and cold without a local search.
void chains(const OneNumberScenarios& rocket, const Settings& settings) {
  constexpr int kScenarios = 32;
  std::printf("rocket, 1 to %d altitudes at random, against %d at once\n", kScenarios, kScenarios);
  std::printf("%6s %14s %8s %10s | %8s %10s %8s %10s | %8s %10s %8s %10s\n", "seed", "objective", "fact.",
              "CPU ms", "cold", "CPU ms", "times", "gap", "bare", "CPU ms", "times", "gap");
  std::vector<double> ratios, bare_ratios, gaps, bare_gaps;
  for (int k = 0; k < settings.seeds; ++k) {
    const int seed = 2 * k + (settings.judging ? 2 : 1);
    const ScenarioProblem problem =
        rocket.scenarios(draws(static_cast<std::uint64_t>(seed), kScenarios, 3.0, 4.8));
    const double begun = 1e3 * processor_seconds();
    const ScenarioSolution grown = solve_scenarios(problem, {.max_sample_size = kScenarios}).value();
    const double ms = 1e3 * processor_seconds() - begun;
    std::int64_t factorizations = 0;
    for (const SampleAverageStage& stage : grown.stages)
      factorizations +=
          stage.factorizations + (stage.out_of_sample ? stage.out_of_sample->factorizations : 0);
    const OwnedProblem whole = assemble_scenarios(problem, kScenarios).value();
    const Cold cold = solve_cold(whole, {});
    Options no_search;
    no_search.max_local_search_factorizations = 0;
    const Cold bare = solve_cold(whole, no_search);
    if (!is_solved(grown.status) || !is_solved(cold.solution.status) || !is_solved(bare.solution.status)) {
      std::printf("%6d grown %s, cold %s, bare %s\n", seed, to_string(grown.status),
                  to_string(cold.solution.status), to_string(bare.solution.status));
      continue;
    }
    const auto gap = [&](const Cold& other) {
      return (grown.objective - other.solution.objective) / std::max(1.0, other.solution.objective);
    };
    ratios.push_back(ms / cold.ms);
    bare_ratios.push_back(ms / bare.ms);
    gaps.push_back(gap(cold));
    bare_gaps.push_back(gap(bare));
    std::printf("%6d %14.6f %8lld %10.1f | %8d %10.1f %8.3f %10.1e | %8d %10.1f %8.3f %10.1e\n", seed,
                grown.objective, static_cast<long long>(factorizations), ms, cold.solution.factorizations,
                cold.ms, ratios.back(), gaps.back(), bare.solution.factorizations, bare.ms,
                bare_ratios.back(), bare_gaps.back());
    std::fflush(stdout);
  }
  if (ratios.empty()) return;
  const auto worst = [](const std::vector<double>& values) { return *std::ranges::max_element(values); };
  std::printf("times of the cold one: median %.3f, worst %.3f; of the bare one: %.3f, %.3f\n", median(ratios),
              worst(ratios), median(bare_ratios), worst(bare_ratios));
  std::printf("above the cold one: median %.1e, worst %.1e; above the bare one: %.1e, %.1e\n\n", median(gaps),
              worst(gaps), median(bare_gaps), worst(bare_gaps));
}

void stages_of(const ScenarioProblem& problem, std::int64_t most) {
  std::printf("%6s %10s %7s  %-10s %13s %8s %10s %9s %5s | %6s %8s %12s %10s %8s\n", "N", "variables",
              "pairs", "end", "objective", "fact.", "ms", "MB", "warm", "out_of_sample", "without", "mean",
              "+-", "fact.");
  ScenarioSettings settings{.max_sample_size = most};
  settings.stage = [](const SampleAverageStage& stage) {
    std::printf("%6lld %10d %7d  %-10s %13.6f %8lld %10.1f %9.1f %5s |",
                static_cast<long long>(stage.scenarios), stage.variables, stage.pairs,
                to_string(stage.status), stage.objective, static_cast<long long>(stage.factorizations),
                1e3 * stage.seconds, 1e-6 * static_cast<double>(stage.memory_bytes),
                stage.warm ? "yes" : "no");
    if (stage.out_of_sample)
      std::printf(" %6lld %8lld %12.6f %10.4f %8lld", static_cast<long long>(stage.out_of_sample->scenarios),
                  static_cast<long long>(stage.out_of_sample->infeasible), stage.out_of_sample->mean,
                  stage.out_of_sample->half_width,
                  static_cast<long long>(stage.out_of_sample->factorizations));
    std::printf("\n");
    std::fflush(stdout);
  };
  const auto answer = solve_scenarios(problem, settings);
  std::printf("%s: %s\n\n", answer ? to_string(answer->end) : "refused",
              answer ? answer->detail.c_str() : answer.error().message().c_str());
}

}  // namespace

void scenarios(const Settings& settings) {
  const auto wanted = [&](const char* part) { return settings.only.empty() || settings.only == part; };
  const OneNumberScenarios rocket = examples::rocket_by_altitude();
  if (wanted("optima")) optima(rocket);
  if (wanted("chains")) chains(rocket, settings);
  if (wanted("many")) {
    std::printf("rocket, 1 to 256 altitudes at random\n");
    stages_of(rocket.scenarios(draws(settings.judging ? 2 : 1, 288, 3.0, 4.8)), 256);
  }
  if (wanted("hopper")) {
    const OneNumberScenarios hopper = examples::hopper_by_friction({.steps = 20});
    std::printf("hopper of 20 steps, 1 to 16 frictions at random between 0.1 and 0.5\n");
    stages_of(hopper.scenarios(draws(settings.judging ? 2 : 1, 32, 0.1, 0.5)), 16);
  }
}

}  // namespace marble::suite
