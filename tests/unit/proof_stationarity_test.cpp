#include <gtest/gtest.h>

#include "marble/solver.h"
#include "proof/stationarity.h"
#include "support/small_problems.h"

namespace marble {
namespace {

// One pair (z₁, z₂) at the origin, with multipliers ξ and η.
Stationarity kind(double xi, double eta, std::vector<double> z = {0.0, 0.0}) {
  OwnedProblem p;
  p.g = {xi, eta};  // ξ e₁ + η e₂ balances g
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  const ScaledProblem problem = scale(Problem::create(p.view()).value(), 0);
  Iterate x(problem);
  x.z() << z[0], z[1];
  x.lambda_L() << -xi;
  x.lambda_R() << -eta;
  Images images(problem);
  images.evaluate(problem, x);
  return classify(images, x);
}

TEST(Stationarity, IsReportedBySignsOfTheMultipliersOfBiactivePairs) {
  EXPECT_EQ(kind(1.0, 1.0), Stationarity::strong);
  EXPECT_EQ(kind(0.0, 1.0), Stationarity::strong);
  EXPECT_EQ(kind(0.0, 0.0), Stationarity::strong);
  EXPECT_EQ(kind(0.0, -1.0), Stationarity::mordukhovich);
  EXPECT_EQ(kind(-1.0, 0.0), Stationarity::mordukhovich);
  EXPECT_EQ(kind(-1.0, -2.0), Stationarity::clarke);
  EXPECT_EQ(kind(1.0, -1.0), Stationarity::weak);
  EXPECT_EQ(kind(-3.0, 1.0), Stationarity::weak);
}

TEST(Stationarity, PairsWithOneSideOpenSayNothing) {
  EXPECT_EQ(kind(-1.0, 0.0, {0.0, 1.0}), Stationarity::strong);
  EXPECT_EQ(kind(0.0, -1.0, {1.0, 0.0}), Stationarity::strong);
}

// Scheel and Scholtes' example: the origin is the minimum, and no multipliers make it strongly stationary.
OwnedProblem without_strong_multipliers() {
  OwnedProblem p;
  p.name = "scheel scholtes";
  p.g = {1.0, 1.0, -1.0};  // min z₁ + z₂ − z₃ s.t. z₃ ≤ 4 z₁, z₃ ≤ 4 z₂
  p.C = compress(2, 3, {{0, 0, 1, 1}, {0, 2, 1, 2}, {4.0, -1.0, 4.0, -1.0}}, "C").value();
  p.d = {0.0, 0.0};
  p.L = compress(1, 3, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 3, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

TEST(Stationarity, AMinimumWithoutStrongMultipliersIsDecidedByItsBranches) {
  const Solution s = solve_in_process(without_strong_multipliers().view()).value();
  ASSERT_EQ(s.status, Status::solved) << s.detail;
  EXPECT_NEAR(s.objective, 0.0, 1e-9);
  EXPECT_NE(s.stationarity, Stationarity::strong);
  EXPECT_NE(s.stationarity, Stationarity::unknown);
  ASSERT_TRUE(s.b_stationary.has_value());
  EXPECT_TRUE(*s.b_stationary);
}

TEST(Stationarity, BranchesAreNotTriedWithoutABudgetForThem) {
  Options options;
  options.max_local_search_factorizations = 0;
  EXPECT_FALSE(
      solve_in_process(without_strong_multipliers().view(), options).value().b_stationary.has_value());
}

TEST(Stationarity, AnswersOfSmallProblemsHaveNoDescentLeft) {
  for (const auto& [problem, optimum] : testing::small_problems()) {
    const Solution s = solve_in_process(problem.view()).value();
    ASSERT_EQ(s.status, Status::solved) << problem.name;
    EXPECT_TRUE(s.b_stationary.value_or(false)) << problem.name << " is " << to_string(s.stationarity);
  }
}

TEST(Stationarity, IsUnknownForWhatIsNotSolved) {
  Options options;
  options.max_iterations = 1;
  const auto problem = testing::public_example().problem;
  EXPECT_EQ(solve_in_process(problem.view(), options).value().stationarity, Stationarity::unknown);
}

}  // namespace
}  // namespace marble
