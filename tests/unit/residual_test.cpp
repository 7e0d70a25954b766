#include "model/residual.h"

#include <gtest/gtest.h>

#include <limits>

#include "dense_system.h"
#include "random_setting.h"
#include "row_parts.h"

namespace marble {
namespace {

using testing::all_shapes;
using testing::dense;
using testing::Setting;

TEST(Residual, IsTheLiteralFormulaForEveryShape) {
  for (const auto& sizes : all_shapes()) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      for (const double kappa : {1e-3, 0.1, 10.0}) {
        const Setting s(sizes, seed, kappa, seed % 2 == 0 ? 1.0 : 1e6);
        const Vector expected = testing::literal_residual(s.problem, s.sub, s.x);
        EXPECT_LT(max_abs(s.r.all - expected), 1e-12 * (1.0 + max_abs(expected)))
            << "seed " << seed << " kappa " << kappa;
      }
    }
  }
}

void expect_jacobian(const Setting& s) {
  const Eigen::MatrixXd J = testing::full_jacobian(s.problem, s.sub, s.x, 0.0);
  for (Eigen::Index j = 0; j < s.x.all.size(); ++j) {
    const double h = 1e-6;
    Vector sides[2];
    for (const int sign : {0, 1}) {
      Iterate moved = s.x;
      moved.all[j] += sign == 0 ? -h : h;
      Images images(s.problem);
      images.evaluate(s.problem, moved);
      Iterate r(s.problem);
      residual(s.sub, images, moved, r);
      sides[sign] = r.all;
    }
    EXPECT_LT(max_abs((sides[1] - sides[0]) / (2.0 * h) - J.col(j)), 1e-7) << "column " << j;
  }
}

TEST(Residual, JacobianIsItsFiniteDifferenceByEitherRetraction) {
  for (const auto& sizes : all_shapes()) {
    Setting s(sizes, 11);
    expect_jacobian(s);
    s.sub.retraction = Retraction::exponential;
    expect_jacobian(s);
  }
}

TEST(Residual, VanishesAtAPointOfTheCentralPathAndNowhereNearIt) {
  // min ½z² − 2z, z ≥ 0 with w·μ = κ and ρ → ∞: z − 2 − μ = 0, z μ = κ, hence z = 1 + √(1 + κ).
  OwnedProblem owned;
  owned.g = {-2.0};
  Triplets one;
  one.add(0, 0, 1.0);
  owned.Q = compress(1, 1, one, "Q").value();
  owned.C = compress(1, 1, one, "C").value();
  owned.d = {0.0};
  const ScaledProblem p = testing::scaled(owned, 0);
  Subproblem sub(p);
  sub.kappa = 0.3;
  sub.rho = 1e12;
  Iterate x(p);
  x.z()[0] = 1.0 + std::sqrt(1.3);
  const double mu = sub.kappa / x.z()[0];
  x.v()[0] = x.z()[0] - mu;
  x.lambda_w()[0] = -mu;
  Images images(p);
  images.evaluate(p, x);
  Iterate r(p);
  residual(sub, images, x, r);
  EXPECT_LT(max_abs(r.all), 1e-11);
  x.z()[0] += 1e-3;
  images.evaluate(p, x);
  residual(sub, images, x, r);
  EXPECT_GT(max_abs(r.all), 1e-4);
}

TEST(Images, AreTheLiteralProducts) {
  for (const auto& sizes : all_shapes()) {
    const Setting s(sizes, 4);
    const ScaledProblem& p = s.problem;
    const Vector z = s.x.z();
    EXPECT_LT(max_abs(s.images.equality - (dense(p.A) * z + p.b)), 1e-13);
    EXPECT_LT(max_abs(s.images.rows.inequality() - (dense(C_of(p)) * z + d_of(p))), 1e-13);
    EXPECT_LT(max_abs(s.images.rows.s() - (dense(L_of(p)) * z + l_of(p))), 1e-13);
    EXPECT_LT(max_abs(s.images.rows.t() - (dense(R_of(p)) * z + r_of(p))), 1e-13);
    EXPECT_LT(max_abs(s.images.gradient - (dense(p.Q) * z + p.g)), 1e-13);
    EXPECT_NEAR(s.images.objective, 0.5 * z.dot(dense(p.Q) * z) + p.g.dot(z), 1e-13);
  }
}

TEST(Images, AdvancedManyTimesAreThoseOfTheMovedPoint) {
  for (const auto& sizes : all_shapes()) {
    Setting s(sizes, 6);
    testing::RandomVectors random(6);
    Iterate d(s.problem);
    Images along(s.problem);
    for (int step = 0; step < 50; ++step) {
      random.fill(d.all);
      along.evaluate_rows(s.problem, d.z());
      along.evaluate_duals(s.problem, d);
      const double alpha = 1.0 / (1.0 + step);
      s.images.advance(alpha, along, d.z());
      s.x.all += alpha * d.all;
    }
    Images fresh(s.problem);
    fresh.evaluate(s.problem, s.x);
    EXPECT_NEAR(s.images.objective, fresh.objective, 1e-11);
    EXPECT_LT(max_abs(s.images.equality - fresh.equality), 1e-12);
    EXPECT_LT(max_abs(s.images.rows.inequality() - fresh.rows.inequality()), 1e-12);
    EXPECT_LT(max_abs(s.images.rows.s() - fresh.rows.s()), 1e-12);
    EXPECT_LT(max_abs(s.images.rows.t() - fresh.rows.t()), 1e-12);
    EXPECT_LT(max_abs(s.images.gradient - fresh.gradient), 1e-12);
    EXPECT_LT(max_abs(s.images.stationarity - fresh.stationarity), 1e-12);
  }
}

TEST(Violations, OfANumberlessPointAreNeverSmall) {
  const Setting s({}, 1);
  const Images& sound = s.images;
  for (const bool equality : {true, false}) {
    const auto part = [equality](auto& images) -> auto& {
      return equality ? images.equality : images.rows.all;
    };
    for (Eigen::Index i = 0; i < part(sound).size(); ++i) {
      Images broken = sound;
      part(broken)[i] = std::numeric_limits<double>::quiet_NaN();
      const Violations v = violations(s.problem, broken);
      EXPECT_TRUE(std::isnan(v.equality) || std::isnan(v.inequality) || std::isnan(v.complementarity)) << i;
    }
  }
}

TEST(MaxAbs, IsTheLargestSizeAndNoNumberIfOneIsNone) {
  EXPECT_EQ(max_abs(Vector()), 0.0);
  for (Eigen::Index size = 1; size < 40; ++size) {
    Vector x = testing::RandomVectors(1).next(size);
    const Eigen::Index at = size / 2;
    x[at] = -3.0;
    EXPECT_EQ(max_abs(x), 3.0);
    x[at] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(std::isnan(max_abs(x))) << size;
  }
}

TEST(Violations, AreZeroWithoutConstraints) {
  const Setting s({.variables = 4, .equalities = 0, .inequalities = 0, .pairs = 0}, 1);
  const Violations v = violations(s.problem, s.images);
  EXPECT_EQ(v.equality + v.inequality + v.complementarity, 0.0);
}

}  // namespace
}  // namespace marble
