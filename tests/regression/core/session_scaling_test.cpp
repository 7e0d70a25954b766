// In a session, min ½Qz² + gz, z ≥ 0 with Q = 1e8, g = −1e4 and then Q = 1, g = −1e-5 was solved with
// z = 1.28e-5 (right: 1e-5); with Q = 1e12, g = −1e6 and then Q = 1, g = −1 with z = 9.1e-4 (right: 1).
//
// A session kept the scale factors of its first numbers, beside which later ones were rounding. Now they are
// made anew where numbers leave the range that they were made for.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "marble/warm_solver.h"
#include "model/scaling.h"
#include "support/dense_matrix.h"
#include "support/random_problem.h"

namespace marble {
namespace {

OwnedProblem one_variable(double q, double g) {
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::MatrixXd::Constant(1, 1, q));
  p.g = {g};
  p.C = testing::sparse(Eigen::MatrixXd::Constant(1, 1, 1.0));
  p.d = {0.0};
  return p;
}

WarmSolver session(const OwnedProblem& p) {
  return WarmSolver::create(Problem::create(p.view()).value()).value();
}

TEST(SessionScaling, FollowsNumbersThatChangeTheirSize) {
  for (const double first : {1e-8, 1e-4, 1.0, 1e4, 1e8, 1e12}) {
    for (const double second : {1e-4, 1.0, 1e4, 1e8, 1e12}) {
      for (const auto& [before, answer] : {std::pair{1.0, 1.0}, {1e-6, 1.0}, {1e-4, 1e-3}, {1e3, 1e3}}) {
        WarmSolver solver = session(one_variable(first, -first * before));
        ASSERT_EQ(solver.solve({}).value().status, Status::solved);
        const std::vector<double> q{second}, g{-second * answer};
        const Solution solution = solver.solve({.g = g, .Q = q}).value();
        const std::string where = std::to_string(std::log10(first)) + " to " +
                                  std::to_string(std::log10(second)) + ": " + solution.detail;
        EXPECT_EQ(solution.status, Status::solved) << where;
        EXPECT_NEAR(solution.z[0], answer, 1e-6 * answer) << where;
      }
    }
  }
}

TEST(SessionScaling, SolvesTheSequencesOfTheReport) {
  WarmSolver solver = session(one_variable(1e8, -1e4));
  EXPECT_NEAR(solver.solve({}).value().z[0], 1e-4, 1e-10);
  EXPECT_NEAR(solver.solve({.g = std::vector<double>{-1e-5}, .Q = std::vector<double>{1.0}}).value().z[0],
              1e-5, 1e-11);
  WarmSolver larger = session(one_variable(1e12, -1e6));
  EXPECT_NEAR(larger.solve({}).value().z[0], 1e-6, 1e-12);
  EXPECT_NEAR(larger.solve({.g = std::vector<double>{-1.0}, .Q = std::vector<double>{1.0}}).value().z[0], 1.0,
              1e-9);
}

// All rows, variables and the cost in other units from one solve to the next.
TEST(SessionScaling, GivesTheAnswerOfAColdSolveInOtherUnits) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const OwnedProblem p = testing::random_problem({.pairs = 0}, seed);
    WarmSolver solver = session(p);
    const Solution before = solver.solve({}).value();
    if (before.status != Status::solved) continue;
    std::mt19937_64 engine(seed);
    std::uniform_int_distribution<int> digits(-4, 4);
    const double cost = std::ldexp(1.0, 4 * digits(engine)), variable = std::ldexp(1.0, 3 * digits(engine));
    const auto times = [](std::vector<double> values, double factor) {
      for (double& value : values) value *= factor;
      return values;
    };
    OwnedProblem other = p;
    other.Q.values = times(p.Q.values, cost * variable * variable);
    other.g = times(p.g, cost * variable);
    for (auto [matrix, offsets] :
         {std::pair{&other.A, &other.b}, {&other.C, &other.d}, {&other.L, &other.l}, {&other.R, &other.r}}) {
      const double row = std::ldexp(1.0, 3 * digits(engine));
      matrix->values = times(matrix->values, row * variable);
      *offsets = times(*offsets, row);
    }
    const Solution solution = solver
                                  .solve({.c0 = cost * p.c0,
                                          .g = other.g,
                                          .b = other.b,
                                          .d = other.d,
                                          .l = other.l,
                                          .r = other.r,
                                          .Q = other.Q.values,
                                          .A = other.A.values,
                                          .C = other.C.values,
                                          .L = other.L.values,
                                          .R = other.R.values})
                                  .value();
    EXPECT_EQ(solution.status, Status::solved) << seed << " " << solution.detail;
    EXPECT_LE(solution.objective, cost * before.objective + 1e-6 * cost * (1.0 + std::abs(before.objective)))
        << seed;
  }
}

TEST(SessionScaling, StaysWhileNumbersKeepTheirSize) {
  const OwnedProblem p = testing::random_problem({}, 1);
  ScaledProblem scaled = scale(Problem::create(p.view()).value(), 10);
  const Vector before = scaled.variable_scale;
  std::vector<double> g = p.g;
  for (double& value : g) value *= 100.0;
  EXPECT_FALSE(rescale({.g = g}, scaled));
  EXPECT_FALSE(refit_scaling(scaled, 10, false));
  EXPECT_EQ(scaled.variable_scale, before);
  for (double& value : g) value *= 1e6;
  EXPECT_FALSE(rescale({.g = g}, scaled));
  EXPECT_TRUE(refit_scaling(scaled, 10, false));
  EXPECT_LE(max_abs(scaled.g), 2.0);
}

// min ½(4x² + 2y² + w²) + gᵀ(x, y, w), y only in Q, with x + w = 1: numbers of any size came and went, and
// the factors that were fitted to them hid from the next fit that they had gone. It ended "solved" with a
// residual of 0.43.
TEST(SessionScaling, FollowsNumbersThatReturn) {
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::Vector3d(4.0, 2.0, 1.0).asDiagonal().toDenseMatrix());
  p.g = {1.5, -2.0, 10.0};
  p.A = testing::sparse(Eigen::RowVector3d(1.0, 0.0, 1.0));
  p.b = {-1.0};
  const Solution expected = session(p).solve({}).value();
  ASSERT_EQ(expected.status, Status::solved);
  for (const double size : {1e5, 2147483647.0, 1e20, 1e154}) {
    WarmSolver gradient = session(p), hessian = session(p);
    const std::vector<double> far = {size, -2.0, 10.0}, steep = {4.0 * size, 2.0, 1.0};
    ASSERT_TRUE(gradient.solve({.g = far}).has_value());
    ASSERT_TRUE(hessian.solve({.Q = steep}).has_value());
    for (const Solution& back :
         {gradient.solve({.g = p.g}).value(), hessian.solve({.Q = p.Q.values}).value()}) {
      EXPECT_EQ(back.status, Status::solved) << size << ": " << back.detail;
      EXPECT_LE(back.kkt_residual, 1e-7) << size;
      for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(back.z[j], expected.z[j], 1e-7) << size;
    }
  }
}

// A session met a gradient of 1e154 or 1e200. Afterwards it ended problems that are unbounded
// "almost_solved", with a third of the gradient left, and refuted others by rows that its factors had made
// huge.
TEST(SessionScaling, ExtremeNumbersThatWentLeaveNoTrace) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p = testing::random_problem({}, seed);
    const ScaledProblem fresh = scale(Problem::create(p.view()).value(), 10);
    for (const double size : {1e20, 1e154, 1e200}) {
      std::vector<double> g = p.g, A = p.A.values, R = p.R.values;
      g[0] = -size, A[0] = size, R[0] = size;
      for (const ProblemUpdate& extreme : {ProblemUpdate{.g = g}, {.A = A}, {.R = R}}) {
        ScaledProblem scaled = fresh;
        bool changed = rescale(extreme, scaled);
        ASSERT_TRUE(refit_scaling(scaled, 10, changed));
        changed = rescale({.g = p.g, .A = p.A.values, .R = p.R.values}, scaled);
        ASSERT_TRUE(refit_scaling(scaled, 10, changed));
        const auto expect_near = [&](const Vector& factors, const Vector& expected) {
          EXPECT_LE(factors.cwiseQuotient(expected).maxCoeff(), 2.0) << seed << " " << size;
          EXPECT_GE(factors.cwiseQuotient(expected).minCoeff(), 0.5) << seed << " " << size;
        };
        expect_near(scaled.variable_scale, fresh.variable_scale);
        expect_near(scaled.equality_scale, fresh.equality_scale);
        expect_near(scaled.row_scale, fresh.row_scale);
        expect_near(Vector::Constant(1, scaled.cost_scale), Vector::Constant(1, fresh.cost_scale));
      }
    }
  }
}

// By powers of two: the same numbers in the old pattern are the same scaled numbers still.
TEST(SessionScaling, LosesNoBit) {
  OwnedProblem p = testing::random_problem({}, 2);
  ScaledProblem scaled = scale(Problem::create(p.view()).value(), 10);
  for (double& value : p.A.values) value *= 1e7;
  ASSERT_TRUE(rescale({.A = p.A.values}, scaled));
  ASSERT_TRUE(refit_scaling(scaled, 10, true));
  ScaledProblem again = scaled;
  rescale({.g = p.g, .b = p.b, .Q = p.Q.values, .A = p.A.values, .C = p.C.values}, again);
  EXPECT_EQ(again.g, scaled.g);
  EXPECT_EQ(again.b, scaled.b);
  EXPECT_EQ(again.Q.values, scaled.Q.values);
  EXPECT_EQ(again.A.values, scaled.A.values);
  EXPECT_EQ(again.rows.values, scaled.rows.values);
}

}  // namespace
}  // namespace marble
