#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "marble/examples.h"
#include "marble/published_examples.h"
#include "marble/solver.h"
#include "research/l1_penalty.h"
#include "research/penalty_scp.h"
#include "research/quadratic_penalty.h"
#include "research/scholtes.h"
#include "research/tuning.h"
#include "research_problems.h"
#include "search/penalty_homotopy.h"
#include "workbench.h"

namespace marble {
namespace {

using State = ReferenceMethod::State;
using testing::two_sides;
using testing::Workbench;

// penalty_scp and l1_penalty: both are QPs without complementarity, whose minima are known on one pair.

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

// What the penalty homotopy promises: where it ends, when it gives up, and what it costs.

// With the cost π xy instead of the pair, the solution of two_sides(q) is x = (1 − 2π/q) / (1 − π²/q²) and
// y = (2 − π/q) / (1 − π²/q²), up to π = ½ q, where x = 0.
struct Ended {
  bool complementary;
  double penalty;
  Vector z;
  int factorizations;
};

Ended follow(const OwnedProblem& p, int budget) {
  testing::Workbench w(p, {.scaling_passes = 0});
  PenaltyHomotopy homotopy(w.problem, *w.kkt);
  const bool complementary = homotopy.run(w.run, w.zero(), budget);
  return {complementary, homotopy.penalty(), homotopy.z(), w.run.factorizations};
}

TEST(PenaltyHomotopy, EndsAtThePenaltyAtWhichTheSmallerSideIsZero) {
  const double first = tuning::homotopy_first;
  for (const double rises : {0.5, 1.5, 2.5}) {  // times between the first penalty and that one
    const double least = first * std::pow(tuning::homotopy_factor, rises - 1.0);
    const Ended end = follow(two_sides(2.0 * least), 100);
    ASSERT_TRUE(end.complementary) << rises;
    EXPECT_NEAR(end.penalty, first * std::pow(tuning::homotopy_factor, std::ceil(rises - 1.0)), 1e-12);
    EXPECT_NEAR(end.z[0], 0.0, tuning::homotopy_complementary) << rises;
    EXPECT_NEAR(end.z[1], 2.0, 0.1) << rises;
  }
}

TEST(PenaltyHomotopy, GivesUpSoonWhereTheFirstPenaltyLeavesMostOfTheProducts) {
  const Ended end = follow(two_sides(1.0), 1000);
  EXPECT_FALSE(end.complementary);
  EXPECT_EQ(end.penalty, tuning::homotopy_first);
  const Ended qpec =
      follow(examples::qpec(
                 {.upper_variables = 10, .lower_variables = 120, .constraints = 4, .degenerate_pairs = 4}, 1),
             1000);
  EXPECT_FALSE(qpec.complementary);
  EXPECT_EQ(qpec.penalty, tuning::homotopy_first);
  EXPECT_LE(qpec.factorizations, 40);
}

TEST(PenaltyHomotopy, EndsThePublishedHopperAtAPointThatIsNearlyComplementary) {
  testing::Workbench w(examples::published_hopper());
  PenaltyHomotopy homotopy(w.problem, *w.kkt);
  ASSERT_TRUE(homotopy.run(w.run, w.zero(), 1000));
  Iterate x(w.problem);
  x.z() = homotopy.z();
  const Images images = w.images(x);
  const Vector smaller = images.rows.s().cwiseMin(images.rows.t());
  EXPECT_LE(smaller.maxCoeff(), tuning::homotopy_complementary);
  EXPECT_GE(images.rows.all.minCoeff(), -1e-2) << "rows are elastic, but not very";
  EXPECT_LE(max_abs(images.equality), 1e-2);
  EXPECT_LE(w.run.factorizations, 500);
}

TEST(PenaltyHomotopy, TakesNoMoreThanItIsGiven) {
  const OwnedProblem p = examples::published_hopper();
  for (const int budget : {1, 20, 60, 150}) {
    const Ended end = follow(p, budget);
    EXPECT_FALSE(end.complementary) << budget;
    EXPECT_LE(end.factorizations, budget);
  }
}

TEST(PenaltyHomotopy, TakesTheNumbersThatTheProblemHasNow) {
  testing::Workbench w(two_sides(2.0 * tuning::homotopy_first), {.scaling_passes = 0});
  PenaltyHomotopy homotopy(w.problem, *w.kkt);
  ASSERT_TRUE(homotopy.run(w.run, w.zero(), 100));
  EXPECT_NEAR(homotopy.z()[1], 2.0, 1e-3);
  std::swap(w.problem.g[0], w.problem.g[1]);
  ASSERT_TRUE(homotopy.run(w.run, w.zero(), w.run.factorizations + 100));
  EXPECT_NEAR(homotopy.z()[0], 2.0, 1e-3);
}

// 33.08 without it; the paper reports 29.20 (Gurobi), 29.21 (LCQPow) and 31.68.
TEST(PenaltyHomotopy, TakesThePublishedHopperBelowWhatThePaperReports) {
  const OwnedProblem p = examples::published_hopper();
  const Solution s = solve_in_process(p.view(), Options{.effort = 0.0}).value();
  EXPECT_EQ(s.status, Status::solved) << s.detail;
  EXPECT_LE(s.objective, 29.21);
  EXPECT_LE(s.factorizations, 1200);
  EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-8);
}

// exterior and alag: Murty's examples, and one pair.

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

// relaxation: where each τ ends, and the whole way.

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
