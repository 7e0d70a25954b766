// A feasible start is never lost: no answer is infeasible or above it.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "marble/examples.h"
#include "marble/solver.h"
#include "marble/warm_solver.h"
#include "support/control_step.h"
#include "support/dense_matrix.h"
#include "support/independent_check.h"
#include "support/random_problem.h"

namespace marble {
namespace {

double objective_at(const OwnedProblem& p, const std::vector<double>& z) {
  return testing::judge_point(p.view(), z).objective;
}

// The optimum of another objective: feasible, and on a branch that is nothing to this one.
std::vector<double> start_of(const OwnedProblem& p, int number) {
  OwnedProblem other = p;
  for (std::size_t j = 0; j < other.g.size(); ++j)
    other.g[j] += 10.0 * std::sin(1.0 + 7.0 * static_cast<double>(j) + 3.0 * number);
  const Solution s = solve_in_process(other.view()).value();
  return is_solved(s.status) ? s.z : std::vector<double>();
}

TEST(FeasibleStart, NoAnswerIsAboveItOnRandomProblems) {
  int starts = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 14, .equalities = 3, .inequalities = 4, .pairs = 6}, seed);
    for (int number = 0; number < 3; ++number) {
      const std::vector<double> start = start_of(p, number);
      if (start.empty()) continue;
      ++starts;
      const double above = objective_at(p, start);
      const Solution s = solve_in_process(p.view(), {}, {.initial_z = start}).value();
      if (s.status == Status::unbounded) continue;
      EXPECT_TRUE(is_solved(s.status)) << seed << ": " << s.detail;
      EXPECT_LE(s.objective, above + 1e-8 * (1.0 + std::abs(above))) << seed;
      EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << seed;
    }
  }
  EXPECT_GT(starts, 100);
}

TEST(FeasibleStart, IsWhatAStoppedSolveAnswersWith) {
  const OwnedProblem p = examples::hopper({.steps = 40});
  const std::vector<double> start = start_of(p, 1);
  ASSERT_FALSE(start.empty());
  const double above = objective_at(p, start);
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  for (const double limit : {0.0, 1e-3, 1e-2}) {
    Options options;
    options.time_limit_s = limit;
    ASSERT_TRUE(solver.set_options(options).has_value());
    const Solution s = solver.solve({.initial_z = start}).value();
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << limit << ": " << s.detail;
    EXPECT_LE(s.objective, above + 1e-8 * (1.0 + std::abs(above))) << limit;
  }
}

TEST(FeasibleStart, IsKeptByAWarmSolverToo) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 14, .equalities = 3, .inequalities = 4, .pairs = 6}, seed);
    WarmSolver solver = WarmSolver::create(Problem::create(p.view()).value()).value();
    ASSERT_TRUE(solver.solve({}, {}, {}).has_value());
    for (int number = 0; number < 3; ++number) {
      const std::vector<double> start = start_of(p, number);
      if (start.empty()) continue;
      const double above = objective_at(p, start);
      const Solution s = solver.solve({}, {.initial_z = start}, {}).value();
      if (s.status == Status::unbounded) continue;
      EXPECT_TRUE(is_solved(s.status)) << seed << ": " << s.detail;
      EXPECT_LE(s.objective, above + 1e-8 * (1.0 + std::abs(above))) << seed;
    }
  }
}

TEST(FeasibleStart, NoAnswerToAControlStepIsAboveItsRollOut) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    testing::ControlSteps steps(seed);
    OwnedProblem p = steps.problem();
    WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
    Solution last;
    for (int tick = 0; tick < 3; ++tick, steps.advance(), p = steps.problem()) {
      const double above = objective_at(p, p.initial_z);
      const auto expect_not_above = [&](const Solution& s, const char* how) {
        EXPECT_EQ(s.status, Status::solved) << how << seed << ": " << s.detail;
        EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << how << seed;
        EXPECT_LE(s.objective, above + 1e-8 * (1.0 + std::abs(above))) << how << seed;
      };
      const Solution alone = solve_in_process(p.view(), {}, {.initial_z = p.initial_z}).value();
      expect_not_above(alone, "alone ");
      const ProblemUpdate numbers{.c0 = p.c0, .g = p.g, .b = p.b, .r = p.r};
      expect_not_above(session.solve(numbers, {.initial_z = p.initial_z}).value(), "session ");
      Solution warm = tick == 0 ? alone : last;
      warm.z = p.initial_z;
      expect_not_above(solve_in_process(p.view(), {}, {.warm_start = &warm}).value(), "warm ");
      last = alone;
    }
  }
}

// reference_objective is then still that of the last cold start.
TEST(FeasibleStart, LeavesNoStepOfAControllerToAColdStart) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    testing::ControlSteps steps(seed);
    OwnedProblem p = steps.problem();
    WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
    const Solution first = session.solve({}, {.initial_z = p.initial_z}).value();
    for (int step = 0; step < 6; ++step) {
      steps.advance();
      p = steps.problem();
      const Solution s =
          session.solve({.c0 = p.c0, .g = p.g, .b = p.b, .r = p.r}, {.initial_z = p.initial_z}).value();
      EXPECT_EQ(s.status, Status::solved) << seed << ": " << s.detail;
      EXPECT_EQ(s.reference_objective, first.objective) << seed << ": " << s.detail;
      EXPECT_LE(s.factorizations, 200) << seed << ": " << s.detail;
    }
  }
}

// min 10⁴x + y² with 0 ≤ x ⊥ 1 − y ≥ 0: x = −5e-7 is feasible to the tolerances, and 5e-3 below the optimum.
// Such a step took 1,000 factorizations and ended with a numerical failure.
TEST(FeasibleStart, MayBeBelowItsBranchByWhatItViolates) {
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::Vector2d(0.0, 2.0).asDiagonal().toDenseMatrix());
  p.g = {1e4, 0.0};
  p.L = testing::sparse(Eigen::RowVector2d(1.0, 0.0));
  p.l = {0.0};
  p.R = testing::sparse(Eigen::RowVector2d(0.0, -1.0));
  p.r = {1.0};
  WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
  ASSERT_TRUE(session.solve({}, {}).has_value());
  const std::vector<double> start = {-5e-7, 0.25};
  const Solution s = session.solve({}, {.initial_z = start}).value();
  EXPECT_EQ(s.status, Status::solved) << s.detail;
  EXPECT_NEAR(s.z[0], 0.0, 1e-9);
  EXPECT_NEAR(s.z[1], 0.0, 1e-9);
  EXPECT_LE(s.factorizations, 10) << s.detail;
}

}  // namespace
}  // namespace marble
