// relaxation: where each τ ends, and the whole way.
#include "research/scholtes.h"

#include <gtest/gtest.h>

#include "research/tuning.h"
#include "research_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using State = ReferenceMethod::State;
using testing::Workbench;

// With κ a tenth of τ: xy + κ/ξ = τ, x − 1 + ξy = κ/x and y − 2 + ξx = κ/y.
TEST(ScholtesRelaxation, EveryTauEndsAtThePointOfItsBarrierProblem) {
  Workbench w(testing::two_sides(1.0), {.scaling_passes = 0});
  ScholtesRelaxation method(w.problem, *w.kkt, w.options);
  method.start(w.zero());
  State state = State::going_on;
  int seen = 0;
  for (double tau = method.relaxation(); state == State::going_on; tau = method.relaxation()) {
    while (state == State::going_on && method.relaxation() == tau) state = method.step(w.run);
    ASSERT_NE(state, State::failed);
    const double kappa = tuning::scholtes_factor * tau;
    const double x = method.iterate().z()[0], y = method.iterate().z()[1];
    EXPECT_LT(x * y, tau * (1.0 + 1e-6));
    const double xi = (1.0 - x + kappa / x) / y;
    EXPECT_NEAR(y - 2.0 + xi * x, kappa / y, 0.1 * tau) << tau;
    EXPECT_NEAR(x * y + kappa / xi, tau, 0.1 * tau) << tau;
    ++seen;
  }
  EXPECT_EQ(state, State::ended);
  EXPECT_GE(seen, 6);
  EXPECT_NEAR(method.iterate().z()[0], 0.0, 1e-6);
  EXPECT_NEAR(method.iterate().z()[1], 2.0, 1e-6);
  EXPECT_NEAR(method.iterate().lambda_L()[0], 1.0, 1e-5);
}

TEST(ScholtesRelaxation, ProblemsWithoutPairsAreInteriorPointProblems) {
  Workbench w(testing::on_a_line());
  ScholtesRelaxation method(w.problem, *w.kkt, w.options);
  method.start(w.zero());
  State state = State::going_on;
  for (int i = 0; i < 100 && state == State::going_on; ++i) state = method.step(w.run);
  EXPECT_EQ(state, State::ended);
  EXPECT_NEAR(w.user(method.iterate().z())[0], 0.5, 1e-6);
}

}  // namespace
}  // namespace marble
