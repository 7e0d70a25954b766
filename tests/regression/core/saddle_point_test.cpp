// min −½x² + ½y² (no bound) was STATUS_SOLVED with objective 0; min −½x² on [−1, 1] was SOLVED at x = 0, a
// local maximum. Nothing said of which order the answer was.
//
// The path stops where the first-order conditions hold, and its exact solution was tried only where Q is
// convex on the active rows. Now the curvature is looked at, negative curvature is followed, and Solution
// says what is known (second_order).
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>

#include "marble/examples.h"
#include "marble/solver.h"
#include "support/dense_algebra.h"
#include "support/dense_matrix.h"

namespace marble {
namespace {

using testing::sparse;

OwnedProblem quadratic(const Eigen::MatrixXd& Q) {
  OwnedProblem p;
  p.Q = sparse(Q);
  p.g.assign(static_cast<std::size_t>(Q.rows()), 0.0);
  return p;
}

// low ≤ z ≤ high in every entry.
void bound(OwnedProblem& p, double low, double high) {
  const auto n = static_cast<Eigen::Index>(p.g.size());
  Eigen::MatrixXd C(2 * n, n);
  C << Eigen::MatrixXd::Identity(n, n), -Eigen::MatrixXd::Identity(n, n);
  p.C = sparse(C);
  p.d.assign(p.g.size(), -low);
  p.d.insert(p.d.end(), p.g.size(), high);
}

// 0 ≤ z₁ ⊥ z₂ ≥ 0.
void pair(OwnedProblem& p) {
  p.L = sparse(Eigen::RowVector2d(1.0, 0.0));
  p.R = sparse(Eigen::RowVector2d(0.0, 1.0));
  p.l = p.r = {0.0};
}

Eigen::MatrixXd one(double value) { return Eigen::MatrixXd::Constant(1, 1, value); }

Eigen::Matrix2d two(double xx, double xy, double yy) {
  Eigen::Matrix2d Q;
  Q << xx, xy, xy, yy;
  return Q;
}

Solution solved(const OwnedProblem& p, const Options& options = {}) {
  return solve_in_process(p.view(), options).value();
}

void expect_minimum(const OwnedProblem& p, double objective, const char* what) {
  const Solution s = solved(p);
  EXPECT_EQ(s.status, Status::solved) << what << ": " << s.detail;
  EXPECT_NEAR(s.objective, objective, 1e-9) << what << ": " << s.detail;
  EXPECT_GE(s.second_order, SecondOrder::minimum) << what << ": " << s.detail;
}

TEST(SaddlePoint, OfAnObjectiveWithoutBoundIsCalledUnbounded) {
  const Solution s = solved(quadratic(two(-1.0, 0.0, 1.0)));
  ASSERT_EQ(s.status, Status::unbounded) << s.detail;
  ASSERT_EQ(s.certificate.size(), 2U);
  EXPECT_LT(-s.certificate[0] * s.certificate[0] + s.certificate[1] * s.certificate[1], 0.0);
  OwnedProblem half = quadratic(one(-1.0));  // z ≥ 0: z = 0 is stationary, its bound without a multiplier
  half.C = sparse(one(1.0));
  half.d = {0.0};
  const Solution ray = solved(half);
  ASSERT_EQ(ray.status, Status::unbounded) << ray.detail;
  EXPECT_EQ(ray.certificate, std::vector<double>{1.0});
  EXPECT_GE(ray.z[0], 0.0) << "the ray begins at a feasible point";
}

TEST(SaddlePoint, OrMaximumInABoxIsLeft) {
  OwnedProblem p = quadratic(one(-1.0));
  bound(p, -1.0, 1.0);
  expect_minimum(p, -0.5, "maximum");
  p.g = {1e-9};
  expect_minimum(p, -0.5, "almost a maximum");
  bound(p = quadratic(one(-1.0)), 0.0, 1.0);
  expect_minimum(p, -0.5, "at a bound without a multiplier");
  bound(p = quadratic(two(-1.0, 0.0, 1.0)), -1.0, 1.0);
  expect_minimum(p, -0.5, "saddle");
  bound(p = quadratic(two(0.0, 1.0, 0.0)), -1.0, 1.0);
  expect_minimum(p, -1.0, "xy");
  bound(p = quadratic(Eigen::MatrixXd::Constant(12, 12, 1.0) - 3.0 * Eigen::MatrixXd::Identity(12, 12)), -1.0,
        1.0);
  expect_minimum(p, -18.0, "many directions");
}

TEST(SaddlePoint, IsReportedFromAMinimumByTheConeNotByItsHull) {
  OwnedProblem p = quadratic(two(0.0, 1.0, 0.0));
  p.C = sparse(Eigen::Matrix2d::Identity());
  p.d = {0.0, 0.0};
  expect_minimum(p, 0.0, "xy over x, y ≥ 0: indefinite, but nowhere negative there");
  p = quadratic(two(0.0, -1.0, 0.0));
  pair(p);
  expect_minimum(p, 0.0, "−xy over 0 ≤ x ⊥ y ≥ 0: both grow on no branch");
  p = quadratic(two(-1.0, 0.0, -1.0));
  pair(p);
  p.C = sparse(-Eigen::Matrix2d::Identity());
  p.d = {1.0, 2.0};
  expect_minimum(p, -2.0, "each branch falls");
}

TEST(SaddlePoint, IsSaidToBeOneWhereItIsNotLeft) {
  OwnedProblem p = quadratic(one(-1.0));
  p.C = sparse(one(1.0));
  p.d = {0.0};
  p.initial_z = {0.0};
  Options options;
  options.max_local_search_factorizations = 0;  // nothing is searched
  for (const bool polish : {false, true}) {
    options.polish = polish;
    const Solution s = solved(p, options);
    EXPECT_LT(s.second_order, SecondOrder::minimum) << s.detail;
  }
}

TEST(SaddlePoint, ConvexProblemsAreMinimaAtNoFurtherFactorization) {
  // A bound without a multiplier: min ½x² over x ≥ 0; and (x − y)², whose rows are dominant only just.
  OwnedProblem p = quadratic(two(2.0, -2.0, 2.0));
  p.C = sparse(Eigen::Matrix2d::Identity());
  p.d = {0.0, 0.0};
  expect_minimum(p, 0.0, "weakly active");
  for (const OwnedProblem& example : {examples::rocket(), examples::gates()}) {
    const Solution s = solved(example);
    EXPECT_EQ(s.second_order, SecondOrder::convex) << s.detail;
  }
}

// Random indefinite QPs in a box, judged by code of its own: no point near is lower, and the Hessian of the
// variables off their bounds has no negative eigenvalue. Of some the path ends infeasible.
TEST(SaddlePoint, RandomIndefiniteProblemsInABoxEndInLocalMinima) {
  int minima = 0;
  constexpr int kSeeds = 150;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::mt19937_64 engine(static_cast<std::uint64_t>(seed));
    const auto uniform = [&engine] { return static_cast<double>(engine() >> 11) * 0x1p-52 - 1.0; };
    const Eigen::Index n = 2 + seed % 17;
    Eigen::MatrixXd Q(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j) Q(i, j) = Q(j, i) = uniform();
    }
    OwnedProblem p = quadratic(Q);
    if (seed % 3 != 0) {  // every third begins at a stationary point
      for (double& entry : p.g) entry = uniform();
    }
    bound(p, -1.0, 1.0);
    const Solution s = solved(p);
    ASSERT_EQ(s.status, Status::solved) << seed << ": " << s.detail;
    minima += s.second_order >= SecondOrder::minimum ? 1 : 0;
    const Eigen::Map<const Eigen::VectorXd> z(s.z.data(), n);
    const Eigen::Map<const Eigen::VectorXd> g(p.g.data(), n);
    const auto f = [&](const Eigen::VectorXd& at) { return 0.5 * at.dot(Q * at) + g.dot(at); };
    EXPECT_NEAR(f(z), s.objective, 1e-9);
    for (int k = 0; k < 200; ++k) {
      Eigen::VectorXd near(n);
      for (Eigen::Index j = 0; j < n; ++j) near[j] = std::clamp(z[j] + 1e-3 * uniform(), -1.0, 1.0);
      EXPECT_GE(f(near), f(z) - 1e-9) << seed << ": " << to_string(s.second_order);
    }
    std::vector<Eigen::Index> inside;
    for (Eigen::Index j = 0; j < n; ++j) {
      if (std::abs(z[j]) < 1.0 - 1e-7) inside.push_back(j);
    }
    if (inside.empty()) continue;
    const Eigen::MatrixXd reduced = Q(inside, inside);
    EXPECT_GE(testing::eigenvalues(reduced).minCoeff(), -1e-6) << seed;
  }
  EXPECT_EQ(minima, kSeeds);
}

}  // namespace
}  // namespace marble
