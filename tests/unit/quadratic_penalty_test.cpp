// exterior and alag: Murty's examples, and one pair.
#include "research/quadratic_penalty.h"

#include <gtest/gtest.h>

#include "research/tuning.h"
#include "research_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using State = ReferenceMethod::State;
using testing::Workbench;

// What x(μ) should be, at every penalty on the way.
void expect_on_the_way(const OwnedProblem& p, double (*x_of)(double)) {
  Workbench w(p, {.scaling_passes = 0});
  BranchEngines branch(w.problem, *w.kkt);
  ExteriorPenalty method(w.problem, w.options, branch);
  method.start(w.zero());
  State state = State::going_on;
  int penalties = 0;
  while (state == State::going_on) {
    const double mu = method.penalty();
    state = method.step(w.run);
    ASSERT_NE(state, State::failed);
    const bool settled = state == State::ended || method.penalty() > mu;
    if (!settled) continue;  // a pair has changed its side
    ++penalties;
    EXPECT_NEAR(method.iterate().z()[0], x_of(mu), 3e-5 * (1.0 + std::abs(x_of(mu))) / std::min(mu, 1.0));
  }
  EXPECT_EQ(state, State::ended);
  EXPECT_GE(penalties, 6);
}

TEST(ExteriorPenalty, IsShortOfAnInequalityByItsMultiplierOverTwiceThePenalty) {
  expect_on_the_way(testing::above_two(), [](double mu) { return 2.0 - 0.5 / mu; });
}

TEST(ExteriorPenalty, IsShortOfAnEqualityAlike) {
  expect_on_the_way(testing::on_a_line(), [](double mu) { return mu / (1.0 + 2.0 * mu); });
}

TEST(ExteriorPenalty, PullsTheSmallerSideOfAPairToZero) {
  expect_on_the_way(testing::two_sides(1.0), [](double mu) { return 1.0 / (1.0 + 2.0 * mu); });
}

TEST(AugmentedLagrangian, EstimatesAreThePenaltysTwiceTheViolationMore) {
  Workbench w(testing::on_a_line(), {.scaling_passes = 0});
  BranchEngines branch(w.problem, *w.kkt);
  AugmentedLagrangian method(w.problem, branch);
  method.start(w.zero());
  const double mu = method.penalty();
  ASSERT_EQ(method.step(w.run), State::going_on);
  EXPECT_NEAR(method.iterate().z()[0], mu / (1.0 + 2.0 * mu), 1e-5);
  const double pi = -2.0 * mu / (1.0 + 2.0 * mu);  // 2μh
  EXPECT_NEAR(method.iterate().y()[0], pi, 1e-5);
  ASSERT_EQ(method.step(w.run), State::going_on);
  EXPECT_NEAR(method.iterate().z()[0], (2.0 * mu - pi) / (2.0 + 4.0 * mu), 1e-5);
  EXPECT_NEAR(method.penalty(), 10.0 * mu, 1e-12) << "h fell by 1 + 2μ only";
}

TEST(AugmentedLagrangian, EndsExactlyAtAModeratePenalty) {
  for (const OwnedProblem& p : {testing::on_a_line(), testing::two_sides(1.0), testing::above_two()}) {
    Workbench w(p, {.scaling_passes = 0});
    BranchEngines branch(w.problem, *w.kkt);
    AugmentedLagrangian method(w.problem, branch);
    method.start(w.zero());
    State state = State::going_on;
    for (int i = 0; i < 100 && state == State::going_on; ++i) state = method.step(w.run);
    EXPECT_EQ(state, State::ended);
    EXPECT_LE(method.penalty(), 10.0) << "estimates, not the penalty, bring it to the end";
    EXPECT_LE(w.judged(method.iterate().z()).infeasibility(), 1e-8);
    EXPECT_LE(max_abs(w.images(method.iterate()).stationarity), 1e-6);
  }
}

}  // namespace
}  // namespace marble
