// Compares long plans of the hopper solved whole, and in segments of 60 steps by solve_in_segments, which is
// given the stages.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "families.h"
#include "marble/composite/segments.h"
#include "marble/examples.h"
#include "support/independent_check.h"

namespace marble::suite {
namespace {

constexpr int kSegmentSteps = 60;

struct Answer {
  double objective = 0.0, seconds = 0.0;  // processor time
  std::int64_t factorizations = 0;
  bool feasible = false;
};

Answer whole(const OwnedProblem& p) {
  const double begin = processor_seconds();
  const Solution s = solve_in_process(p.view()).value();
  return {s.objective, processor_seconds() - begin, s.factorizations,
          is_solved(s.status) && testing::judge(p.view(), s).infeasibility() <= 1e-6};
}

Answer in_segments(const OwnedProblem& p, int steps) {
  std::vector<Index> stage;
  for (int k = 0; k < steps; ++k) stage.insert(stage.end(), examples::kHopperVariables, k);
  const double begin = processor_seconds();
  const SegmentsSolution s = solve_in_segments(Problem::create(p.view()).value(), stage,
                                               {.num_segments = std::max(1, steps / kSegmentSteps)})
                                 .value();
  return {s.whole.objective, processor_seconds() - begin,
          s.sweep_factorizations + s.coordination.last.factorizations + s.whole.factorizations,
          is_solved(s.whole.status) && testing::judge(p.view(), s.whole).infeasibility() <= 1e-6};
}

}  // namespace

// The numbers of segments were tuned on even seeds; --judge uses odd ones.
void horizons(const Settings& settings) {
  std::printf("%6s %5s %16s %8s %8s %16s %8s %8s %9s %9s\n", "steps", "seed", "whole", "fact.", "CPU s",
              "segments", "fact.", "CPU s", "objective", "time");
  for (int steps = 120; steps <= 1920; steps *= 2) {
    if (settings.steps != 0 && steps != settings.steps) continue;
    std::vector<double> objectives, times;
    int feasible = 0, near = 0;
    for (int i = 0; i < settings.seeds; ++i) {
      const int seed = 2 * i + (settings.judging ? 1 : 0);  // 0: unchanged
      examples::HopperParameters parameters;
      if (seed > 0) parameters = examples::vary(parameters, static_cast<std::uint64_t>(seed));
      parameters.steps = steps;
      const OwnedProblem p = examples::hopper(parameters);
      const Answer a = whole(p), b = in_segments(p, steps);
      objectives.push_back(a.objective / b.objective), times.push_back(a.seconds / b.seconds);
      feasible += a.feasible, near += a.feasible && a.objective <= 1.05 * b.objective;
      std::printf("%6d %5d %16.6f %8lld %8.2f %16.6f %8lld %8.2f %9.3f %9.2f\n", steps, seed, a.objective,
                  static_cast<long long>(a.factorizations), a.seconds, b.objective,
                  static_cast<long long>(b.factorizations), b.seconds, objectives.back(), times.back());
      std::fflush(stdout);
    }
    std::printf(
        "%6d: %d of %d feasible, %d within 5 %% of the segments; objective median %.3f worst %.3f, time "
        "median %.2f worst %.2f of theirs\n",
        steps, feasible, settings.seeds, near, median(objectives), *std::ranges::max_element(objectives),
        median(times), *std::ranges::max_element(times));
  }
  std::printf("\n");
}

}  // namespace marble::suite
