#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "families.h"
#include "marble/composite/segments.h"
#include "marble/examples.h"
#include "support/coupled_problems.h"
#include "support/independent_check.h"
#include "support/threads.h"

namespace marble::suite {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point begin) {
  return 1e3 * std::chrono::duration<double>(Clock::now() - begin).count();
}

constexpr int kThreads = 2;  // the number of cores of the measuring machine

struct CoupledTally {
  int solved = 0, as_good = 0, better = 0, agreed = 0, frozen = 0, switches = 0, wrong = 0;
  std::vector<double> iterations, factorizations, monolithic_factorizations, ms, monolithic_ms, gaps;
};

void random_family(const char* name, const testing::CoupledSizes& sizes, int seeds) {
  CoupledTally tally;
  testing::Threads threads(kThreads);
  for (int seed = 0; seed < seeds; ++seed) {
    const testing::OwnedCoupled coupled = testing::random_coupled(sizes, static_cast<std::uint64_t>(seed));
    const CoupledView view = coupled.view();
    const OwnedProblem monolithic = monolithic_problem(view);
    auto begin = Clock::now();
    const Solution whole = solve_in_process(monolithic.view()).value();
    tally.monolithic_ms.push_back(ms_since(begin));
    tally.monolithic_factorizations.push_back(whole.factorizations);
    begin = Clock::now();
    const CoupledSolution answer = solve_coupled(view, {}, {.runner = &threads}).value();
    tally.ms.push_back(ms_since(begin));
    tally.iterations.push_back(answer.coordination.last.iteration);
    tally.factorizations.push_back(
        static_cast<double>(answer.coordination.last.factorizations + answer.monolithic.factorizations));
    tally.agreed += answer.coordination.status == Status::solved;
    tally.frozen += answer.coordination.frozen_at > 0;
    tally.switches += answer.coordination.pair_switches;
    if (!is_solved(answer.monolithic.status)) {
      std::printf("  seed %d: %s, whole %s\n", seed, to_string(answer.monolithic.status),
                  to_string(whole.status));
      tally.as_good += !is_solved(whole.status);
      continue;
    }
    ++tally.solved;
    tally.wrong += testing::judge(monolithic.view(), answer.monolithic).infeasibility() > 1e-6;
    const double gap =
        (answer.monolithic.objective - whole.objective) / std::max(1.0, std::abs(whole.objective));
    tally.as_good += !is_solved(whole.status) || gap <= 1e-6;
    tally.better += !is_solved(whole.status) || gap < -1e-6;
    if (gap > 1e-6) tally.gaps.push_back(gap);
  }
  std::printf("%-22s %5d %6d %6d %8d %7d %7d %6d %7.0f %7.0f %9.0f %9.0f %9.2f %9.2f %10.2g\n", name, seeds,
              tally.solved, tally.wrong, tally.as_good, tally.better, tally.agreed, tally.frozen,
              median(tally.iterations), *std::ranges::max_element(tally.iterations),
              median(tally.factorizations), median(tally.monolithic_factorizations), median(tally.ms),
              median(tally.monolithic_ms), tally.gaps.empty() ? 0.0 : median(tally.gaps));
  std::fflush(stdout);
}

std::vector<Index> stages_of_hopper(int steps) {
  std::vector<Index> stages;
  for (int k = 0; k < steps; ++k) stages.insert(stages.end(), examples::kHopperVariables, k);
  return stages;
}

void hoppers_in_segments(int only_steps) {
  std::printf("%6s %6s %22s %8s %6s %12s %9s %12s %16s %16s %10s %22s\n", "steps", "segments", "segments end",
              "iterat.", "switches", "fact. blocks", "monolithic", "ms", "objective", "of the blocks",
              "whole ms", "whole");
  testing::Threads threads(kThreads);
  for (const auto& [steps, segments] :
       {std::pair{120, 2}, std::pair{240, 4}, std::pair{480, 8}, std::pair{960, 16}, std::pair{1920, 32}}) {
    if (only_steps != 0 && steps != only_steps) continue;
    examples::HopperParameters parameters;
    parameters.steps = steps;
    const OwnedProblem p = examples::hopper(parameters);
    const Problem problem = Problem::create(p.view()).value();
    SegmentsOptions options;
    options.num_segments = segments;
    auto begin = Clock::now();
    const SegmentsSolution answer =
        solve_in_segments(problem, stages_of_hopper(steps), options, {.runner = &threads}).value();
    const double ms = ms_since(begin);
    std::printf("%6d %6d %22s %8d %6d %12lld %9d %12.1f %16.9f %16.9f", steps, segments,
                to_string(answer.whole.status), answer.coordination.last.iteration,
                answer.coordination.pair_switches,
                static_cast<long long>(answer.coordination.last.factorizations), answer.whole.factorizations,
                ms, answer.whole.objective, answer.blocks_objective);
    std::fflush(stdout);
    if (steps <= 480) {
      begin = Clock::now();
      const Solution whole = solve_once(problem).value();
      std::printf(" %10.1f %22s %16.9f", ms_since(begin), to_string(whole.status), whole.objective);
    }
    std::printf("\n    one after the other: %.9f, %lld factorizations\n", answer.sweep_objective,
                static_cast<long long>(answer.sweep_factorizations));
    std::printf("    %s\n", answer.whole.detail.c_str());
    std::fflush(stdout);
  }
}

/// Budgets that bind: a share of the hoppers' largest need when each is solved separately.
void hoppers_on_a_budget() {
  std::printf("%7s %5s %8s %22s %8s %7s %12s %8s %14s %14s %8s %22s %14s\n", "hoppers", "steps", "budget",
              "ends", "iterat.", "frozen", "fact. blocks", "s", "objective", "of the blocks", "whole s",
              "whole", "objective");
  testing::Threads threads(kThreads);
  for (const double share : {0.95, 0.85}) {
    constexpr int kSteps = 30;
    testing::OwnedCoupled hoppers = testing::hoppers_on_a_budget(10, kSteps, 0.0);
    std::vector<double> forces(kSteps, 0.0);
    for (std::size_t k = 0; k + 1 < hoppers.blocks.size(); ++k) {
      const Solution alone = solve_in_process(hoppers.blocks[k].view()).value();
      for (int step = 0; step < kSteps; ++step)
        forces[static_cast<std::size_t>(step)] +=
            alone.z[static_cast<std::size_t>(examples::hopper_index(step, examples::kForceZ))];
    }
    const double budget = share * *std::ranges::max_element(forces);
    hoppers.coupling_rhs.assign(kSteps, budget);
    const CoupledView view = hoppers.view();
    auto begin = Clock::now();
    const CoupledSolution answer =
        solve_coupled(view, {.monolithic_search = false}, {.runner = &threads}).value();
    const double seconds = 1e-3 * ms_since(begin);
    const OwnedProblem monolithic = monolithic_problem(view);
    begin = Clock::now();
    const Solution whole = solve_in_process(monolithic.view()).value();
    std::printf("%7d %5d %8.2f %22s %8d %7d %12lld %8.1f %14.6f %14.6f %8.1f %22s %14.6f\n", 10, kSteps,
                budget, to_string(answer.monolithic.status), answer.coordination.last.iteration,
                answer.coordination.frozen_at,
                static_cast<long long>(answer.coordination.last.factorizations), seconds,
                answer.monolithic.objective, answer.blocks_objective, 1e-3 * ms_since(begin),
                to_string(whole.status), whole.objective);
    std::printf("    %s\n", answer.monolithic.detail.c_str());
    std::fflush(stdout);
  }
}

}  // namespace

void coupled(const Settings& settings) {
  std::printf("%-22s %5s %6s %6s %8s %7s %7s %6s %7s %7s %9s %9s %9s %9s %10s\n", "family", "seeds", "solved",
              "wrong", "as good", "better", "agreed", "frozen", "iter.", "worst", "fact.", "whole", "ms",
              "whole", "gap of the rest");
  if (settings.only.empty() || settings.only == "small")
    random_family("3 x 4, 2 pairs", {}, 3 * settings.seeds);
  if (settings.only.empty() || settings.only == "large")
    random_family("10 x 40, 10 pairs", {.blocks = 10, .variables = 40, .pairs = 10, .rows = 10},
                  10 * settings.seeds);
  if (settings.only.empty() || settings.only == "hoppers") hoppers_on_a_budget();
  if (settings.only.empty() || settings.only == "segments") hoppers_in_segments(settings.steps);
}

}  // namespace marble::suite
