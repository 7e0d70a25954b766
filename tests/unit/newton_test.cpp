#include "path/newton.h"

#include <gtest/gtest.h>

#include "dense_system.h"
#include "random_setting.h"
#include "row_parts.h"
#include "support/dense_algebra.h"

namespace marble {
namespace {

using testing::all_shapes;
using testing::backends;
using testing::dense;
using testing::full_jacobian;
using testing::RandomSizes;
using testing::Setting;

// Compares the condensed step with one dense LU of the full system; false if the inertia is wrong there.
bool expect_full_step(const Setting& s, Kkt& kkt, double delta, bool clip, double tolerance) {
  Newton newton(s.problem, kkt);
  if (!newton.factor(s.sub, s.x, delta, clip)) return false;
  Iterate d(s.problem);
  Images along(s.problem);
  EXPECT_TRUE(newton.direction(s.sub, s.x, s.r, d, along));
  const Eigen::MatrixXd J = full_jacobian(s.problem, s.sub, s.x, delta, clip);
  const Vector expected = testing::dense_solve(J, -s.r.all);
  EXPECT_LT(max_abs(d.all - expected), tolerance * (1.0 + max_abs(expected))) << kkt.name();
  return true;
}

TEST(Newton, CondensedStepIsTheStepOfTheFullSystemForEveryShapeAndBackend) {
  for (const RandomSizes& sizes : all_shapes()) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const Setting s(sizes, seed);
      for (const auto& kkt : backends(s.problem)) {
        SCOPED_TRACE(::testing::Message() << "n_e " << sizes.equalities << " n_i " << sizes.inequalities
                                          << " n_c " << sizes.pairs << " seed " << seed);
        EXPECT_TRUE(expect_full_step(s, *kkt, 1.0, true, 1e-9));
        EXPECT_TRUE(expect_full_step(s, *kkt, 10.0, false, 1e-9));
        EXPECT_TRUE(expect_full_step(s, *kkt, 0.0, true, 1e-9));
      }
    }
  }
}

TEST(Newton, StepStaysExactWhereKappaIsSmallAndRhoLarge) {
  for (const double kappa : {1e-8, 1e-2, 10.0}) {
    for (const double rho : {1.0, 1e3, 1e6}) {
      for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        Setting s({}, seed, kappa, rho);
        for (const auto& kkt : backends(s.problem)) {
          SCOPED_TRACE(::testing::Message() << "kappa " << kappa << " rho " << rho << " seed " << seed);
          EXPECT_TRUE(expect_full_step(s, *kkt, 1e-9, true, 1e-7));
        }
      }
    }
  }
}

TEST(Newton, StepIsThatOfTheFullSystemForIndefiniteProblemsToo) {
  int compared = 0;
  for (const RandomSizes& shape : all_shapes()) {
    RandomSizes sizes = shape;
    sizes.indefinite = true;
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const Setting s(sizes, seed);
      for (const auto& kkt : backends(s.problem)) {
        double delta = 0.1;
        while (delta < 100.0 && !expect_full_step(s, *kkt, delta, false, 1e-8)) delta *= 4.0;
        compared += delta < 100.0 ? 1 : 0;
      }
    }
  }
  EXPECT_EQ(compared, 8 * 5 * 4) << "every problem becomes convex at some δ";
}

TEST(Newton, StepByTheExponentialRetractionIsThatOfTheFullSystem) {
  for (const RandomSizes& sizes : all_shapes()) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      Setting s(sizes, seed);
      s.sub.retraction = Retraction::exponential;
      residual(s.sub, s.images, s.x, s.r);
      EXPECT_LT(max_abs(s.r.all - testing::literal_residual(s.problem, s.sub, s.x)), 1e-10);
      for (const auto& kkt : backends(s.problem)) {
        EXPECT_TRUE(expect_full_step(s, *kkt, 1.0, true, 1e-9));
        EXPECT_TRUE(expect_full_step(s, *kkt, 10.0, false, 1e-9));
      }
    }
  }
}

TEST(Newton, ImagesOfTheStepAreItsLiteralProducts) {
  for (const RandomSizes& sizes : all_shapes()) {
    const Setting s(sizes, 7);
    const ScaledProblem& p = s.problem;
    for (const auto& kkt : backends(p)) {
      Newton newton(p, *kkt);
      ASSERT_TRUE(newton.factor(s.sub, s.x, 1.0, true));
      Iterate d(p);
      Images along(p);
      ASSERT_TRUE(newton.direction(s.sub, s.x, s.r, d, along));
      const double tolerance = 1e-12 * (1.0 + max_abs(d.all));
      EXPECT_LT(max_abs(along.equality - dense(p.A) * d.z()), tolerance);
      EXPECT_LT(max_abs(along.rows.inequality() - dense(C_of(p)) * d.z()), tolerance);
      EXPECT_LT(max_abs(along.rows.s() - dense(L_of(p)) * d.z()), tolerance);
      EXPECT_LT(max_abs(along.rows.t() - dense(R_of(p)) * d.z()), tolerance);
      const Vector gradient = dense(p.Q) * d.z();
      EXPECT_LT(max_abs(along.gradient - gradient), tolerance);
      const Vector stationarity =
          gradient + dense(p.A).transpose() * d.y() + dense(C_of(p)).transpose() * d.lambda_w() +
          dense(L_of(p)).transpose() * d.lambda_L() + dense(R_of(p)).transpose() * d.lambda_R();
      EXPECT_LT(max_abs(along.stationarity - stationarity), tolerance);
    }
  }
}

TEST(Newton, AStepCutsTheResidualOfANearlySolvedSubproblemQuadratically) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Setting s({}, seed, 1.0, 10.0);
    const auto kkt = make_kkt(s.problem);
    Newton newton(s.problem, *kkt);
    Iterate d(s.problem);
    Images along(s.problem);
    const auto step = [&] {
      EXPECT_TRUE(newton.factor(s.sub, s.x, 0.0, false));
      ASSERT_TRUE(newton.direction(s.sub, s.x, s.r, d, along));
      s.x.all += d.all;
      s.images.evaluate(s.problem, s.x);
      residual(s.sub, s.images, s.x, s.r);
    };
    // Start where the residual is 0 by choice of the data the residual is affine in, then move a little off.
    s.x.lambda_L() = -s.x.lambda_L().cwiseAbs();
    s.x.lambda_R() = -s.x.lambda_R().cwiseAbs();
    for (Eigen::Index i = 0; i < s.problem.pairs(); ++i) {
      s.x.lambda_R()[i] = s.x.lambda_L()[i] * testing::p_slope(s.x.sigma()[i], s.sub.kappa) /
                          testing::p_slope(-s.x.sigma()[i], s.sub.kappa);
    }
    for (Eigen::Index i = 0; i < s.problem.inequalities(); ++i)
      s.x.lambda_w()[i] = -testing::p(-s.x.v()[i], s.sub.kappa);
    s.images.evaluate(s.problem, s.x);
    residual(s.sub, s.images, s.x, s.r);
    s.problem.g -= s.r.z();
    s.sub.equality_estimate -= s.sub.rho * s.r.y();
    s.sub.row_estimate.all -= s.sub.rho * s.r.lambda();
    s.x.all += 1e-3 * testing::RandomVectors(seed).next(s.x.all.size());
    s.images.evaluate(s.problem, s.x);
    residual(s.sub, s.images, s.x, s.r);
    const double before = max_abs(s.r.all);
    EXPECT_GT(before, 1e-5);
    step();
    EXPECT_LT(max_abs(s.r.all), 10.0 * before * before) << seed;
    step();
    EXPECT_LT(max_abs(s.r.all), 1e-8) << seed;
  }
}

TEST(Newton, InertiaVerdictIsThatOfTheFullSystem) {
  int right = 0;
  int wrong = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Setting s({.indefinite = seed % 2 == 0}, seed);
    const Eigen::MatrixXd J = full_jacobian(s.problem, s.sub, s.x, 0.0);
    // v and λ_w of an inequality are not symmetric in (13); its pivot w/μ + 1/ρ is positive always, so leave
    // it out.
    const Index n = s.problem.variables(), n_c = s.problem.pairs(), n_i = s.problem.inequalities();
    Eigen::MatrixXd condensed = J;
    for (Index i = 0; i < n_i; ++i) {
      const double v = s.x.v()[i];
      const Index at = n + n_c + i, lambda = n + n_c + n_i + s.problem.equalities() + i;
      condensed.row(at).setZero();
      condensed.col(at).setZero();
      condensed(at, at) = 1.0;  // a positive pivot of its own
      condensed(lambda, lambda) =
          -(1.0 / s.sub.rho + testing::p(v, s.sub.kappa) / testing::p(-v, s.sub.kappa));
    }
    const Vector eigenvalues = testing::eigenvalues(condensed);
    const bool expected = (eigenvalues.array() > 0.0).count() == n + n_c + n_i;
    (expected ? right : wrong) += 1;
    for (const auto& kkt : backends(s.problem)) {
      Newton newton(s.problem, *kkt);
      EXPECT_EQ(newton.factor(s.sub, s.x, 0.0, false), expected) << kkt->name() << " seed " << seed;
    }
  }
  EXPECT_GT(right, 3);
  EXPECT_GT(wrong, 3);
}

TEST(Newton, InertiaVerdictIsTheConvexityOfTheCondensedHessianForEveryShape) {
  int right = 0;
  int wrong = 0;
  for (const RandomSizes& shape : all_shapes()) {
    RandomSizes sizes = shape;
    sizes.indefinite = true;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      const Setting s(sizes, seed);
      const double delta = 0.3 * static_cast<double>(seed);
      const Eigen::MatrixXd L = dense(L_of(s.problem)), R = dense(R_of(s.problem)), A = dense(s.problem.A);
      Eigen::MatrixXd H = dense(s.problem.Q) + s.sub.rho * A.transpose() * A;
      H.diagonal().array() += delta;
      bool expected = true;
      for (Index i = 0; i < s.problem.inequalities(); ++i) {
        const double ratio = testing::p(s.x.v()[i], s.sub.kappa) / testing::p(-s.x.v()[i], s.sub.kappa);
        const Eigen::RowVectorXd row = dense(C_of(s.problem)).row(i);
        H += row.transpose() * row / (1.0 / s.sub.rho + ratio);
      }
      for (Index i = 0; i < s.problem.pairs(); ++i) {  // design page: W, with b² for the left-left entry
        const double a = testing::p_slope(s.x.sigma()[i], s.sub.kappa), b = 1.0 - a;
        const double q = testing::pair_curvature(s.sub, s.x, i, false) + delta, u2 = a * a + b * b;
        const double pivot = u2 + q / s.sub.rho;
        expected = expected && pivot > 0.0;
        Eigen::Matrix2d stiff, soft;
        stiff << b * b, a * b, a * b, a * a;
        soft << a * a, -a * b, -a * b, b * b;
        Eigen::MatrixXd rows(2, s.problem.variables());
        rows << L.row(i), R.row(i);
        H += rows.transpose() * (s.sub.rho * stiff + q / pivot * soft) * rows / u2;
      }
      const double smallest = testing::eigenvalues(H).minCoeff();
      expected = expected && smallest > 0.0;
      (expected ? right : wrong) += 1;
      for (const auto& kkt : backends(s.problem)) {
        Newton newton(s.problem, *kkt);
        EXPECT_EQ(newton.factor(s.sub, s.x, delta, false), expected)
            << kkt->name() << " seed " << seed << " smallest eigenvalue " << smallest;
      }
    }
  }
  EXPECT_GT(right, 5);
  EXPECT_GT(wrong, 5);
}

TEST(Newton, ClippingGivesTheRightInertiaForConvexProblems) {
  for (const RandomSizes& sizes : all_shapes()) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const Setting s(sizes, seed);
      for (const auto& kkt : backends(s.problem)) {
        Newton newton(s.problem, *kkt);
        EXPECT_TRUE(newton.factor(s.sub, s.x, 1e-9, true)) << kkt->name() << " seed " << seed;
      }
    }
  }
}

TEST(Newton, ANumberlessPointIsWrongInertiaNotACrash) {
  Setting s({}, 1);
  s.x.sigma()[0] = s.x.v()[0] = std::numeric_limits<double>::quiet_NaN();
  for (const auto& kkt : backends(s.problem)) {
    Newton newton(s.problem, *kkt);
    EXPECT_FALSE(newton.factor(s.sub, s.x, 1.0, true)) << kkt->name();
  }
}

}  // namespace
}  // namespace marble
