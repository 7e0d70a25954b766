// Problems without pairs: Mehrotra's method, and exact solutions of the rows it shows.
#include <gtest/gtest.h>

#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/small_problems.h"

namespace marble {
namespace {

OwnedProblem one_variable(double curvature, double slope) {  // min ½ q z² + g z in [0, 1]
  OwnedProblem p;
  p.Q = {1, 1, {0, 1}, {0}, {curvature}};
  p.g = {slope};
  p.C = {2, 1, {0, 2}, {0, 1}, {1.0, -1.0}};
  p.d = {0.0, 1.0};
  return p;
}

TEST(Quadratic, AnObstacleProblemTakesFewFactorizationsAndIsExact) {
  const OwnedProblem p = testing::obstacle_problem(1000);
  const Solution s = solve_in_process(p.view()).value();
  ASSERT_EQ(s.status, Status::solved);
  EXPECT_LE(s.factorizations, 60);
  const testing::Verdict verdict = testing::judge(p.view(), s);
  EXPECT_LE(verdict.infeasibility(), 1e-12);
  EXPECT_LE(verdict.stationarity, 1e-10);
}

TEST(Quadratic, ASolutionInACornerIsExact) {
  const Solution s = solve_in_process(one_variable(1.0, 3.0).view()).value();
  EXPECT_EQ(s.status, Status::solved);
  EXPECT_EQ(s.z[0], 0.0);
  EXPECT_NEAR(s.inequality_multipliers[0], 3.0, 1e-9);
}

TEST(Quadratic, NegativeCurvatureIsLeftToTheOtherEngines) {
  const Solution s = solve_in_process(one_variable(-2.0, -0.1).view()).value();
  EXPECT_EQ(s.status, Status::solved);
  EXPECT_NEAR(s.objective, -1.1, 1e-9);
}

TEST(Quadratic, ContradictionsAreStillProved) {
  OwnedProblem p = one_variable(1.0, 0.0);
  p.d = {-2.0, 1.0};  // z ≥ 2 and z ≤ 1
  const Solution s = solve_in_process(p.view()).value();
  EXPECT_EQ(s.status, Status::infeasible);
}

TEST(Quadratic, AnIterationLimitGivesThePointReached) {
  const OwnedProblem p = testing::obstacle_problem(100);
  Options options;
  options.max_iterations = 3;
  const Solution s = solve_in_process(p.view(), options).value();
  EXPECT_EQ(s.status, Status::iteration_limit);
  EXPECT_EQ(s.iterations, 3);
  EXPECT_LT(s.objective, 0.0);  // of the point to start from: 0
}

}  // namespace
}  // namespace marble
