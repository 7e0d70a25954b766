// What the merit and its weights promise, and what the loop does where they alone would end it.
#include "nonlinear/merit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "formula.h"
#include "marble/nonlinear.h"

namespace marble::testing {
namespace {

using nonlinear::Weights;

nonlinear::Multipliers multipliers_of(double equality, double inequality, double G, double H) {
  return {.equalities = {equality}, .inequalities = {inequality}, .G = {G}, .H = {H}, .bounds = {}};
}

// murty-nlp-lectures, MSQP: max{|π|, ½(μ + |π|)} has to be strictly above |π|.
TEST(NonlinearMerit, WeightsAreStrictlyAboveTheMultipliersAndFollowThemDown) {
  const double zero[] = {0.0};
  Weights weights({.equalities = zero, .inequalities = zero, .G = zero, .H = zero}, 1.0);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> exponent(-4.0, 6.0);
  std::bernoulli_distribution negative(0.5);
  for (int round = 0; round < 200; ++round) {
    const auto drawn = [&] { return std::pow(10.0, exponent(random)) * (negative(random) ? -1.0 : 1.0); };
    const auto pi = multipliers_of(drawn(), std::abs(drawn()), drawn(), drawn());
    const double before = weights.equalities()[0];
    weights.rise_above(pi);
    EXPECT_GT(weights.equalities()[0], std::abs(pi.equalities[0]));
    EXPECT_GT(weights.inequalities()[0], pi.inequalities[0]);
    EXPECT_GT(weights.pairs()[0], std::max(std::abs(pi.G[0]), std::abs(pi.H[0])));
    EXPECT_LE(weights.equalities()[0], 1.01 * std::max(before, std::abs(pi.equalities[0])) + 1e-3);
  }
  for (int round = 0; round < 60; ++round) weights.rise_above(multipliers_of(0.5, 0.5, 0.5, 0.5));
  EXPECT_NEAR(weights.most(), 0.5, 0.01);  // large ones of once do not stay
}

TEST(NonlinearMerit, APairCountsWithTheLeastChangeThatMakesItComplementary) {
  EXPECT_EQ(nonlinear::pair_violation(0.0, 3.0), 0.0);
  EXPECT_EQ(nonlinear::pair_violation(2.0, 3.0), 2.0);
  EXPECT_EQ(nonlinear::pair_violation(-2.0, 3.0), 2.0);
  EXPECT_EQ(nonlinear::pair_violation(-2.0, -3.0), 5.0);
}

// Both multipliers are −2 at the origin: C-stationary, but along either side the objective descends.
TEST(NonlinearMerit, ACornerThatIsOnlyClarkeStationaryIsLeft) {
  const Formula corner{.name = "corner", .optimum = 1, .start = {0, 0}, .parts = [](const Jets& x) -> Parts {
                         return {.objective = square(x[0] - 1) + square(x[1] - 1) + square(square(x[0])),
                                 .G = {x[0]},
                                 .H = {x[1]}};
                       }};
  const auto answer = nonlinear::solve(problem_of(corner), nonlinear::open_ticks_in_process);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->status, Status::solved) << answer->detail;
  EXPECT_EQ(answer->b_stationary, true);
  EXPECT_EQ(objection(corner, *answer), "");
  EXPECT_LT(answer->objective, 1.3);  // 2 at the corner; 1 and 1.29 at the minima of the two branches
}

// hakonsen: near its start no step lowers the violation, and the objective has to wait.
TEST(NonlinearMerit, RestorationIsEnteredAndLeftAgain) {
  for (const Formula& formula : equilibrium_problems()) {
    if (formula.name != "hakonsen") continue;
    std::vector<bool> restoring;
    nonlinear::Settings settings;
    settings.iteration = [&](const nonlinear::Iteration& row) { restoring.push_back(row.restoring); };
    const auto answer = nonlinear::solve(problem_of(formula), nonlinear::open_ticks_in_process, settings);
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_EQ(answer->status, Status::solved) << answer->detail;
    EXPECT_NE(std::find(restoring.begin(), restoring.end(), true), restoring.end());
    ASSERT_FALSE(restoring.empty());
    EXPECT_FALSE(restoring.back());
    return;
  }
  FAIL() << "hakonsen is not among the equilibrium problems";
}

}  // namespace
}  // namespace marble::testing
