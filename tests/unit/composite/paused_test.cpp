// Solves of many problems ask whether to make way for others in all their parts, and their time limits stand
// still meanwhile.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <vector>

#include "marble/composite/lifted_block.h"
#include "marble/composite/segments.h"
#include "marble/examples.h"
#include "marble/scenario_examples.h"
#include "support/coupled_problems.h"

namespace marble {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kLimitS = 1e-3;  // less than any of these solves takes

// The clock of a solve that is paused all the time runs backwards, so no time limit is reached by it.
class Backwards final : public Pause {
 public:
  void look() override { ++looks_; }
  [[nodiscard]] Clock::duration paused() const override { return 1000 * (Clock::now() - begun_); }
  [[nodiscard]] int looks() const { return looks_; }

 private:
  const Clock::time_point begun_ = Clock::now();
  std::atomic<int> looks_ = 0;
};

TEST(Pauses, AreAskedForByEachBlock) {
  const testing::OwnedCoupled c =
      testing::random_coupled({.blocks = 6, .variables = 40, .pairs = 12, .rows = 4}, 7);
  const CoupledSolution free = solve_coupled(c.view()).value();
  Backwards pause;
  CoupledOptions options;
  options.options.time_limit_s = kLimitS;
  const CoupledSolution paused = solve_coupled(c.view(), options, {.pause = &pause}).value();
  EXPECT_EQ(paused.monolithic.status, free.monolithic.status) << paused.monolithic.detail;
  EXPECT_EQ(paused.monolithic.z, free.monolithic.z);
  EXPECT_GE(pause.looks(), paused.coordination.last.factorizations + paused.monolithic.factorizations);
}

TEST(Pauses, AreAskedForInDenseAlgebra) {
  constexpr std::size_t kRows = 300;
  std::vector<double> response(kRows * kRows, 0.0);
  for (std::size_t i = 0; i < kRows; ++i) response[i * (kRows + 1)] = 0.5;
  Backwards pause;
  EXPECT_EQ(without_proximal(response, kRows, 1.0, {.pause = &pause}),
            without_proximal(response, kRows, 1.0));
  EXPECT_GE(pause.looks(), 10);
}

TEST(Pauses, AreAskedForByEachSegment) {
  constexpr int kSteps = 24;
  const OwnedProblem p = examples::hopper({.steps = kSteps});
  const Problem problem = Problem::create(p.view()).value();
  std::vector<Index> stages;
  for (Index j = 0; j < kSteps * examples::kHopperVariables; ++j)
    stages.push_back(j / examples::kHopperVariables);
  SegmentsOptions options{.num_segments = 3};
  const SegmentsSolution free = solve_in_segments(problem, stages, options).value();
  Backwards pause;
  options.coupled.options.time_limit_s = kLimitS;
  const SegmentsSolution paused = solve_in_segments(problem, stages, options, {.pause = &pause}).value();
  EXPECT_EQ(paused.whole.status, free.whole.status) << paused.whole.detail;
  EXPECT_EQ(paused.whole.z, free.whole.z);
  EXPECT_GE(pause.looks(), paused.sweep_factorizations + paused.coordination.last.factorizations +
                               paused.whole.factorizations);
}

TEST(Pauses, AreAskedForByEachStageAndRecourse) {
  const examples::OneNumberScenarios rocket = examples::rocket_by_altitude();
  const ScenarioProblem problem = rocket.scenarios({3.9, 3.4, 4.2, 3.6, 4.4, 3.2, 4.0, 3.8});
  ScenarioSettings settings{.max_sample_size = 4};
  const ScenarioSolution free = solve_scenarios(problem, settings).value();
  Backwards pause;
  settings.options.time_limit_s = kLimitS;
  const ScenarioSolution paused = solve_scenarios(problem, settings, {.pause = &pause}).value();
  EXPECT_EQ(paused.end, free.end) << paused.detail;
  EXPECT_EQ(paused.x, free.x);
  EXPECT_EQ(paused.recourse, free.recourse);
  EXPECT_GE(pause.looks(), paused.solution.factorizations);
  ASSERT_EQ(paused.stages.size(), free.stages.size());
  for (std::size_t k = 0; k < free.stages.size(); ++k)
    EXPECT_EQ(paused.stages[k].out_of_sample->mean, free.stages[k].out_of_sample->mean);
}

}  // namespace
}  // namespace marble
