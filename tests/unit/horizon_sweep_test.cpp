// Segments one after the other: together they are a point of the whole, which further passes only lower.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "horizon/sweep.h"
#include "marble/examples.h"
#include "support/independent_check.h"

namespace marble {
namespace {

constexpr int kSteps = 40;

OwnedProblem hopper(std::uint64_t seed) {
  examples::HopperParameters parameters = examples::vary(examples::HopperParameters{}, seed);
  parameters.steps = kSteps;
  return examples::hopper(parameters);
}

std::vector<Index> steps() {
  std::vector<Index> result;
  for (int k = 0; k < kSteps; ++k) result.insert(result.end(), examples::kHopperVariables, k);
  return result;
}

Solution swept(const OwnedProblem& p, const SweepPlan& plan, const SolveControls& controls = {}) {
  return sweep(Problem::create(p.view()).value(), plan, {}, controls, {}).value();
}

TEST(Sweep, SegmentsThatAreSolvedAreAFeasiblePointOfTheWhole) {
  const std::vector<Index> stage = steps(), ends = {10, 20, 30, 40};
  for (const std::uint64_t seed : {0, 1, 2, 3}) {
    const OwnedProblem p = hopper(seed);
    const Solution s = swept(p, {.stage_of_variable = stage, .ends = ends});
    ASSERT_TRUE(is_solved(s.status)) << s.detail;
    const testing::Verdict verdict = testing::judge(p.view(), s);
    EXPECT_LE(verdict.infeasibility(), 1e-9) << "seed " << seed;
    EXPECT_NEAR(verdict.objective, s.objective, 1e-8 * (1.0 + std::abs(s.objective)));
  }
}

TEST(Sweep, FurtherPassesKeepItFeasibleAndNeverRaiseTheObjective) {
  const std::vector<Index> stage = steps(), ends = {10, 20, 30, 40};
  for (const std::uint64_t seed : {0, 1, 2, 3}) {
    const OwnedProblem p = hopper(seed);
    double last = swept(p, {.stage_of_variable = stage, .ends = ends}).objective;
    for (const int passes : {1, 2}) {
      const Solution s = swept(p, {.stage_of_variable = stage, .ends = ends, .passes = passes});
      ASSERT_TRUE(is_solved(s.status)) << s.detail;
      EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-9) << "seed " << seed;
      EXPECT_LE(s.objective, last + 1e-9 * (1.0 + std::abs(last))) << "seed " << seed;
      last = s.objective;
    }
  }
}

// ½x² + ½y², y = x − 1 and y ≥ 0; x alone would be 0, and then there is no y.
TEST(Sweep, ASegmentThatLeavesNoWayOnIsSolvedOnceMoreWithTheNextOne) {
  OwnedProblem p;
  Triplets Q, A, C;
  Q.add(0, 0, 1.0), Q.add(1, 1, 1.0);
  A.add(0, 0, 1.0), A.add(0, 1, -1.0);
  C.add(0, 1, 1.0);
  p.g = {0.0, 0.0};
  p.Q = compress(2, 2, Q, "Q").value();
  p.A = compress(1, 2, A, "A").value(), p.b = {-1.0};
  p.C = compress(1, 2, C, "C").value(), p.d = {0.0};
  const std::vector<Index> stage = {0, 1}, ends = {1, 2};
  const Solution s = swept(p, {.stage_of_variable = stage, .ends = ends, .overlap = 0});
  ASSERT_TRUE(is_solved(s.status)) << s.detail;
  EXPECT_NEAR(s.z[0], 1.0, 1e-9);
  EXPECT_NEAR(s.z[1], 0.0, 1e-9);
}

// 1 ≤ y ≤ 0, whatever x is.
TEST(Sweep, OneThatHasNoAnswerIsNamed) {
  OwnedProblem p;
  Triplets Q, C;
  Q.add(0, 0, 1.0), Q.add(1, 1, 1.0);
  C.add(0, 1, 1.0), C.add(1, 1, -1.0);
  p.g = {0.0, 0.0};
  p.Q = compress(2, 2, Q, "Q").value();
  p.C = compress(2, 2, C, "C").value(), p.d = {-1.0, 0.0};
  const std::vector<Index> stage = {0, 1}, ends = {1, 2};
  const Solution s = swept(p, {.stage_of_variable = stage, .ends = ends, .overlap = 0});
  EXPECT_EQ(s.status, Status::infeasible);
  EXPECT_EQ(s.detail.rfind("segment 1", 0), 0U) << s.detail;
}

TEST(Sweep, AStopEndsIt) {
  std::stop_source stop;
  stop.request_stop();
  const std::vector<Index> stage = steps(), ends = {20, 40};
  const Solution s = swept(hopper(0), {.stage_of_variable = stage, .ends = ends}, {.stop = stop.get_token()});
  EXPECT_EQ(s.status, Status::cancelled);
}

}  // namespace
}  // namespace marble
