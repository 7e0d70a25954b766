// Long horizons in segments: what is cut adds up to the whole, and is solved as the whole.
#include "marble/composite/segments.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "marble/examples.h"
#include "support/dense_matrix.h"
#include "support/independent_check.h"

namespace marble {
namespace {

std::vector<Index> stages(int steps) {
  std::vector<Index> result;
  for (int k = 0; k < steps; ++k) result.insert(result.end(), examples::kHopperVariables, k);
  return result;
}

TEST(Segments, AnAnswerOfTheWholeIsOneOfTheSegmentsTogether) {
  const OwnedProblem p = examples::hopper({.steps = 20});
  const Solution whole = solve_in_process(p.view()).value();
  ASSERT_TRUE(is_solved(whole.status));
  const Segments segments =
      cut(Problem::create(p.view()).value(), segments_by_stage(stages(20), 3).value()).value();
  ASSERT_TRUE(check(segments.view()).has_value());
  const CoupledStart start = segments.start(whole);
  Solution monolithic;
  for (const Solution& block : start.blocks) {
    const auto append = [&](std::vector<double> Solution::*values) {
      (monolithic.*values).insert((monolithic.*values).end(), (block.*values).begin(), (block.*values).end());
    };
    append(&Solution::z), append(&Solution::equality_multipliers), append(&Solution::inequality_multipliers);
    append(&Solution::complementarity_multipliers_L), append(&Solution::complementarity_multipliers_R);
  }
  monolithic.equality_multipliers.insert(monolithic.equality_multipliers.end(),
                                         start.coupling_multipliers.begin(),
                                         start.coupling_multipliers.end());
  const OwnedProblem together = monolithic_problem(segments.view());
  const testing::Verdict verdict = testing::judge(together.view(), monolithic);
  EXPECT_NEAR(verdict.objective, whole.objective, 1e-9 * (1.0 + std::abs(whole.objective)));
  EXPECT_LE(verdict.infeasibility(), 1e-6);
  EXPECT_LE(verdict.stationarity, 1e-6);
}

TEST(Segments, TheyAgreeOnTheObjectiveOfTheirMonolithicBranch) {
  const OwnedProblem p = examples::hopper({.steps = 120});
  const SegmentsSolution answer =
      solve_in_segments(Problem::create(p.view()).value(), stages(120), {.num_segments = 2}).value();
  ASSERT_TRUE(is_solved(answer.whole.status)) << answer.whole.detail;
  EXPECT_EQ(answer.coordination.status, Status::solved) << answer.coordination.detail;
  EXPECT_NEAR(answer.blocks_objective, answer.whole.objective,
              1e-7 * (1.0 + std::abs(answer.whole.objective)));
  EXPECT_LE(answer.whole.objective, answer.sweep_objective);
  const testing::Verdict verdict = testing::judge(p.view(), answer.whole);
  EXPECT_LE(verdict.infeasibility(), 1e-6);
  EXPECT_LE(verdict.stationarity, 1e-6);
}

TEST(Segments, ThatOverlapTooLittleAgreeByShorterSteps) {
  const OwnedProblem p = examples::hopper({.steps = 240});
  const SegmentsSolution answer =
      solve_in_segments(Problem::create(p.view()).value(), stages(240), {.num_segments = 4, .overlap = 8})
          .value();
  ASSERT_TRUE(is_solved(answer.whole.status)) << answer.whole.detail;
  EXPECT_EQ(answer.coordination.status, Status::solved) << answer.coordination.detail;
  EXPECT_EQ(answer.coordination.last.proximal, 100.0) << "not held harder";
}

TEST(Segments, WhereOneFailsTheWholeIsSolvedFromTheirSweep) {
  // The first segment is left with −½x², which ρ = ½ does not hold and ρ = 100 does.
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::MatrixXd{{1.0, 2.0}, {2.0, 5.0}});
  p.g = {1.0, -1.0};
  const Problem problem = Problem::create(p.view()).value();
  const std::vector<Index> stages = {0, 1};
  const SegmentsSolution held = solve_in_segments(problem, stages).value();
  EXPECT_EQ(held.coordination.status, Status::solved) << held.coordination.detail;

  SegmentsOptions options;
  options.coupled.proximal = 0.5;
  const SegmentsSolution failed = solve_in_segments(problem, stages, options).value();
  EXPECT_EQ(failed.coordination.failed_block, 0U) << failed.coordination.detail;
  EXPECT_NE(failed.whole.detail.find("so the whole was solved from the segments one after the other"),
            std::string::npos)
      << failed.whole.detail;
  for (const SegmentsSolution* answer : {&held, &failed}) {
    ASSERT_TRUE(is_solved(answer->whole.status)) << answer->whole.detail;
    EXPECT_NEAR(answer->whole.z[0], -7.0, 1e-8);
    EXPECT_NEAR(answer->whole.z[1], 3.0, 1e-8);
  }
}

TEST(Segments, StagesAndSegmentsOutOfRangeAreNamed) {
  EXPECT_EQ(segments_by_stage({}, 1).error().field, "stages");
  EXPECT_EQ(segments_by_stage(std::vector<Index>{0, -1}, 1).error().field, "stages");
  EXPECT_EQ(segments_by_stage(std::vector<Index>{0, 1}, 3).error().field, "num_segments");
  EXPECT_EQ(segments_by_stage(std::vector<Index>{0, 1, 2, 3}, 2).value(), (std::vector<Index>{0, 0, 1, 1}));

  const OwnedProblem p = examples::hopper({.steps = 3});
  const Problem problem = Problem::create(p.view()).value();
  EXPECT_EQ(cut(problem, std::vector<Index>{0}).error().field, "segments");
  std::vector<Index> none_in_1(p.g.size(), 0);
  none_in_1.back() = 2;
  EXPECT_FALSE(cut(problem, none_in_1).has_value());
  none_in_1.back() = -1;
  EXPECT_EQ(cut(problem, none_in_1).error().index, static_cast<std::int64_t>(p.g.size()) - 1);
  EXPECT_EQ(solve_in_segments(problem, stages(3), {.overlap = -2}).error().field, "overlap");
  EXPECT_EQ(solve_in_segments(problem, stages(3), {.coupled = {.freeze_after = 5, .monolithic = false}})
                .error()
                .field,
            "monolithic");
}

// As under UndefinedBehaviorSanitizer: the largest numbers that a request may have overflow nothing.
TEST(Segments, TheLargestOverlapReachesTheEnd) {
  const OwnedProblem p = examples::hopper({.steps = 6});
  const Problem problem = Problem::create(p.view()).value();
  std::vector<double> objectives;
  for (const Index overlap : {5, 1 << 30, std::numeric_limits<Index>::max()}) {
    const auto answer = solve_in_segments(problem, stages(6), {.num_segments = 2, .overlap = overlap});
    ASSERT_TRUE(answer) << answer.error().message();
    ASSERT_TRUE(is_solved(answer->whole.status)) << answer->whole.detail;
    objectives.push_back(answer->sweep_objective);
  }
  EXPECT_EQ(objectives[0], objectives[1]);
  EXPECT_EQ(objectives[0], objectives[2]);
}

TEST(Segments, TheLargestStageIsOneLessThanAnIndex) {
  std::vector<Index> far = {0, std::numeric_limits<Index>::max() - 1};
  EXPECT_EQ(segments_by_stage(far, 2).value(), (std::vector<Index>{0, 1}));
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::MatrixXd::Identity(2, 2));
  p.g = {-1.0, 1.0};
  const auto answer = solve_in_segments(Problem::create(p.view()).value(), far, {.num_segments = 2});
  ASSERT_TRUE(answer) << answer.error().message();
  EXPECT_NEAR(answer->whole.objective, -1.0, 1e-9);
  ++far[1];
  const auto refused = segments_by_stage(far, 2);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message(), "stages[1] = 2147483647: must be in [0, 2147483646]");
}

}  // namespace
}  // namespace marble
