// The reference that others are compared with: it must be right where the answer is known.
#include "support/brute_force.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "marble/macmpec.h"
#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

double slack(double objective) { return 1e-6 * std::max(1.0, std::abs(objective)); }

TEST(BruteForce, ProvesTheOptimumOfEverySmallProblem) {
  for (const auto& [problem, optimum] : small_problems()) {
    const auto best = brute_force(problem.view());
    ASSERT_TRUE(best.has_value()) << problem.name;
    EXPECT_NEAR(best->objective, optimum, slack(optimum)) << problem.name;
    EXPECT_LE(judge_point(problem.view(), best->z).infeasibility(), 1e-6) << problem.name;
  }
}

TEST(BruteForce, ProvesTheOptimumOfEveryKnownProblem) {
  int proved = 0;
  for (const auto& [problem, optimum] : known_problems()) {
    if (problem.l.size() > 10) continue;
    ++proved;
    const auto best = brute_force(problem.view());
    ASSERT_TRUE(best.has_value()) << problem.name;
    EXPECT_NEAR(best->objective, optimum, slack(optimum)) << problem.name;
    EXPECT_LE(judge_point(problem.view(), best->z).infeasibility(), 1e-6) << problem.name;
  }
  EXPECT_EQ(proved, 29) << "of one with 12 pairs the collection's own word is taken";
}

TEST(BruteForce, ProvesTheOptimaOfMacmpec) {
  int proved = 0;
  for (const examples::MacmpecProblem& each : examples::macmpec()) {
    const OwnedProblem problem = each.problem();
    if (problem.l.size() > 10) continue;
    ++proved;
    const auto best = brute_force(problem.view());
    ASSERT_TRUE(best.has_value()) << each.name;
    EXPECT_NEAR(best->objective, each.optimum, slack(each.optimum)) << each.name;
  }
  EXPECT_EQ(proved, 24);
}

TEST(BruteForce, NoFeasibleRandomPointIsBetter) {
  // The point that a random problem is built around is feasible; so are those the solver returns.
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p =
        random_problem({.variables = 8, .equalities = 2, .inequalities = 4, .pairs = 4}, seed);
    const auto best = brute_force(p.view());
    ASSERT_TRUE(best.has_value()) << p.name;
    EXPECT_GE(best->feasible_branches, 1);
    EXPECT_LE(judge_point(p.view(), best->z).infeasibility(), 1e-6) << p.name;
    EXPECT_NEAR(judge_point(p.view(), best->z).objective, best->objective, slack(best->objective)) << p.name;
    const Solution s = solve_in_process(p.view()).value();
    if (!is_solved(s.status)) continue;
    ++compared;
    EXPECT_GE(s.objective, best->objective - slack(best->objective)) << p.name;
  }
  EXPECT_GE(compared, 15);
}

OwnedProblem two_variables(double gradient_x, double gradient_y) {
  OwnedProblem p;
  p.g = {gradient_x, gradient_y};
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = {0.0};
  p.r = {0.0};
  return p;
}

TEST(BruteForce, SaysWhenNoPieceIsFeasible) {
  OwnedProblem p = two_variables(1.0, 1.0);
  p.C = compress(2, 2, {{0, 1}, {0, 1}, {1.0, 1.0}}, "C").value();
  p.d = {-1.0, -1.0};  // x ≥ 1 and y ≥ 1, but x y = 0
  EXPECT_FALSE(brute_force(p.view()).has_value());
  p.d = {-1.0, 0.0};
  const auto best = brute_force(p.view());
  ASSERT_TRUE(best.has_value());
  EXPECT_EQ(best->feasible_branches, 1);
  EXPECT_NEAR(best->objective, 1.0, 1e-6);
}

TEST(BruteForce, SaysWhenAPieceIsUnbounded) {
  const auto best = brute_force(two_variables(1.0, -1.0).view());
  ASSERT_TRUE(best.has_value());
  EXPECT_EQ(best->objective, -std::numeric_limits<double>::infinity());
}

TEST(BruteForce, ReadsEitherFormOfQ) {
  OwnedProblem p = two_variables(-1.0, -2.0);
  p.Q = compress(2, 2, {{0, 0, 1, 1}, {0, 1, 0, 1}, {2.0, 1.0, 1.0, 2.0}}, "Q").value();
  const double full = brute_force(p.view())->objective;
  p.Q = compress(2, 2, {{0, 0, 1}, {0, 1, 1}, {2.0, 1.0, 2.0}}, "Q").value();
  p.hessian_form = HessianForm::upper_triangle;
  EXPECT_NEAR(full, -1.0, 1e-6);
  EXPECT_NEAR(brute_force(p.view())->objective, full, 1e-9);
}

TEST(BruteForce, RefusesWhatItCannotProve) {
  OwnedProblem p = two_variables(0.0, 0.0);
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {-1.0, 1.0}}, "Q").value();
  EXPECT_THROW(static_cast<void>(brute_force(p.view())), std::invalid_argument);
  const OwnedProblem many = random_problem({.variables = 12, .pairs = 13}, 1);
  EXPECT_THROW(static_cast<void>(brute_force(many.view())), std::invalid_argument);
}

}  // namespace
}  // namespace marble::testing
