// penalty_scp and l1_penalty: both are QPs without complementarity, whose minima are known on one pair.
#include <gtest/gtest.h>

#include "research/l1_penalty.h"
#include "research/penalty_scp.h"
#include "research/tuning.h"
#include "research_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using State = ReferenceMethod::State;
using testing::two_sides;
using testing::Workbench;

// The QP's minimum is (1 − π y/q, 2 − π x/q); the slope of f + πφ to it −5π²/q, the curvature 5π²/q + 4π³/q².
TEST(PenaltyScp, TheFirstStepIsTheExactOneAlongTheLinearizedPenalty) {
  const double q = 0.1, pi = tuning::reference_first;
  Workbench w(two_sides(q), {.scaling_passes = 0});
  PenaltyScp method(w.problem, *w.kkt);
  method.start(w.zero());
  ASSERT_EQ(method.step(w.run), State::going_on);
  EXPECT_NEAR(method.iterate().z()[0], 1.0, 1e-9) << "the minimum without complementarity";
  EXPECT_NEAR(method.iterate().z()[1], 2.0, 1e-9);
  EXPECT_EQ(method.penalty(), pi);
  ASSERT_EQ(method.step(w.run), State::going_on);
  const double alpha = 5.0 / (5.0 + 4.0 * pi / q);
  EXPECT_NEAR(method.step_length(), alpha, 1e-9);
  EXPECT_NEAR(method.iterate().z()[0], 1.0 - alpha * 2.0 * pi / q, 1e-9);
  EXPECT_NEAR(method.iterate().z()[1], 2.0 - alpha * pi / q, 1e-9);
}

// f + πxy has x = (1 − 2π/q)/(1 − π²/q²) > 0 up to π = q/2.
TEST(PenaltyScp, EndsAtTheFirstPenaltyThatMakesTheSmallerSideZeroWithItsMultipliers) {
  Workbench w(two_sides(0.1), {.scaling_passes = 0});
  PenaltyScp method(w.problem, *w.kkt);
  method.start(w.zero());
  State state = State::going_on;
  for (int i = 0; i < 200 && state == State::going_on; ++i) state = method.step(w.run);
  ASSERT_EQ(state, State::ended);
  EXPECT_NEAR(method.penalty(), 0.08, 1e-12) << ".01, .02 and .04 are less than .05";
  EXPECT_NEAR(method.iterate().z()[0], 0.0, 1e-12);
  EXPECT_NEAR(method.iterate().z()[1], 2.0, 1e-9);
  EXPECT_NEAR(method.iterate().lambda_L()[0], 0.1, 1e-9) << "q(0 − 1) + λ = 0";
  EXPECT_NEAR(method.iterate().lambda_R()[0], 0.0, 1e-9);
}

TEST(L1Penalty, TheSmallerSideFallsByThePenaltyAndIsZeroOnceThatIsTheMultiplier) {
  const double q = 0.1, mu = tuning::reference_first;
  Workbench w(two_sides(q), {.scaling_passes = 0});
  L1Penalty method(w.problem, *w.kkt);
  method.start(w.zero());
  ASSERT_EQ(method.step(w.run), State::going_on);
  ASSERT_EQ(method.step(w.run), State::going_on);
  EXPECT_NEAR(method.iterate().z()[0], 1.0 - mu / q, 1e-9);
  EXPECT_NEAR(method.iterate().z()[1], 2.0, 1e-9);
  ASSERT_EQ(method.step(w.run), State::ended) << "μ = .1 is the multiplier";
  EXPECT_NEAR(method.penalty(), 0.1, 1e-12);
  EXPECT_NEAR(method.iterate().z()[0], 0.0, 1e-9);
  EXPECT_NEAR(method.iterate().lambda_L()[0], q, 1e-9);
}

}  // namespace
}  // namespace marble
