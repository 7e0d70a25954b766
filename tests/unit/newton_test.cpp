#include "newton.h"

#include <gtest/gtest.h>

#include "dense_kkt.h"
#include "dense_system.h"
#include "sparse_kkt.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using testing::full_jacobian;
using testing::random_problem;
using testing::RandomSizes;

struct Setting {
  explicit Setting(const RandomSizes& sizes, std::uint64_t seed, double kappa = 0.1, double rho = 50.0)
      : owned(random_problem(sizes, seed)),
        problem(scale(Problem::create(owned.view()).value(), 10)),
        sub(problem),
        x(problem),
        r(problem),
        images(problem) {
    std::srand(static_cast<unsigned>(seed));
    x.all.setRandom();
    sub.kappa = kappa;
    sub.rho = rho;
    sub.equality_estimate.setRandom();
    sub.inequality_estimate.setRandom();
    sub.left_estimate.setRandom();
    sub.right_estimate.setRandom();
    images.evaluate(problem, x);
    residual(sub, images, x, r);
  }
  OwnedProblem owned;
  ScaledProblem problem;
  Subproblem sub;
  Iterate x, r;
  Images images;
};

std::vector<std::unique_ptr<Kkt>> backends(const ScaledProblem& p) {
  std::vector<std::unique_ptr<Kkt>> all;
  all.push_back(std::make_unique<SparseKkt>(p, KeptRows::none));
  all.push_back(std::make_unique<SparseKkt>(p, KeptRows::dense));
  all.push_back(std::make_unique<SparseKkt>(p, KeptRows::all));
  all.push_back(std::make_unique<DenseKkt>(p));
  return all;
}

TEST(Residual, JacobianIsItsFiniteDifference) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Setting s({}, seed);
    const Eigen::MatrixXd J = full_jacobian(s.problem, s.sub, s.x, 0.0);
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
}

TEST(Newton, CondensedStepIsTheStepOfTheFullSystemForEveryShapeAndBackend) {
  int shapes = 0;
  for (const Index n_e : {0, 3}) {
    for (const Index n_i : {0, 5}) {
      for (const Index n_c : {0, 4}) {
        ++shapes;
        for (std::uint64_t seed = 1; seed <= 5; ++seed) {
          Setting s({.variables = 14, .equalities = n_e, .inequalities = n_i, .pairs = n_c}, seed);
          const double delta = 1.0;  // makes the random point's system convex enough for one factorization
          for (const auto& kkt : backends(s.problem)) {
            Newton newton(s.problem, *kkt);
            if (!newton.factor(s.sub, s.x, delta, false)) continue;
            Iterate d(s.problem);
            Images along(s.problem);
            newton.direction(s.sub, s.x, s.r, d, along);
            const Vector expected = full_jacobian(s.problem, s.sub, s.x, delta).fullPivLu().solve(-s.r.all);
            EXPECT_LT(max_abs(d.all - expected), 1e-9 * (1.0 + max_abs(expected)))
                << kkt->name() << " n_e " << n_e << " n_i " << n_i << " n_c " << n_c << " seed " << seed;
          }
        }
      }
    }
  }
  EXPECT_EQ(shapes, 8);
}

TEST(Newton, ImagesOfTheStepMoveTheImagesOfThePoint) {
  Setting s({}, 7);
  const auto kkt = make_kkt(s.problem);
  Newton newton(s.problem, *kkt);
  ASSERT_TRUE(newton.factor(s.sub, s.x, 1.0, true));
  Iterate d(s.problem);
  Images along(s.problem);
  newton.direction(s.sub, s.x, s.r, d, along);
  Images moved = s.images;
  moved.advance(0.3, along, d.z());
  Iterate x = s.x;
  x.all += 0.3 * d.all;
  Images fresh(s.problem);
  fresh.evaluate(s.problem, x);
  EXPECT_NEAR(moved.objective, fresh.objective, 1e-12 * (1.0 + std::abs(fresh.objective)));
  EXPECT_LT(max_abs(moved.equality - fresh.equality), 1e-12);
  EXPECT_LT(max_abs(moved.inequality - fresh.inequality), 1e-12);
  EXPECT_LT(max_abs(moved.left - fresh.left), 1e-12);
  EXPECT_LT(max_abs(moved.right - fresh.right), 1e-12);
  EXPECT_LT(max_abs(moved.gradient - fresh.gradient), 1e-12);
  EXPECT_LT(max_abs(moved.stationarity - fresh.stationarity), 1e-12);
}

TEST(Newton, InertiaVerdictIsThatOfTheFullSystem) {
  int right = 0;
  int wrong = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Setting s({.indefinite = seed % 2 == 0}, seed);
    const Eigen::MatrixXd J = full_jacobian(s.problem, s.sub, s.x, 0.0);
    // v and λ_w of an inequality are not symmetric in (13); its pivot w/μ + 1/ρ is positive always, so leave
    // it out.
    const Index n = s.problem.variables(), n_c = s.problem.pairs(), n_i = s.problem.inequalities();
    Eigen::MatrixXd condensed = J;
    for (Index i = 0; i < n_i; ++i) {
      const Retraction w(s.x.v()[i], s.sub.kappa);
      const Index v = n + n_c + i, lambda = n + n_c + n_i + s.problem.equalities() + i;
      condensed.row(v).setZero();
      condensed.col(v).setZero();
      condensed(v, v) = 1.0;  // a positive pivot of its own
      condensed(lambda, lambda) = -(1.0 / s.sub.rho + w.positive / w.negative);
    }
    const Vector eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(condensed).eigenvalues();
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

TEST(Newton, ClippingGivesTheRightInertiaForConvexProblems) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Setting s({}, seed);
    for (const auto& kkt : backends(s.problem)) {
      Newton newton(s.problem, *kkt);
      EXPECT_TRUE(newton.factor(s.sub, s.x, 1e-9, true)) << kkt->name() << " seed " << seed;
    }
  }
}

}  // namespace
}  // namespace marble
