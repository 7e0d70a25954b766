#include "kkt/kkt.h"

#include <gtest/gtest.h>

#include "dense_system.h"
#include "random_setting.h"
#include "random_vector.h"
#include "support/dense_algebra.h"

namespace marble {
namespace {

using testing::all_shapes;
using testing::backends;
using testing::dense_system;
using testing::random_problem;
using testing::RandomVectors;
using testing::scaled;

RowWeights random_weights(const ScaledProblem& p, unsigned seed, bool with_zeros) {
  RandomVectors random(seed);
  RowWeights weights(p);
  weights.rho = 20.0;
  weights.delta = 0.01;
  const auto positive = [&](VectorRef v) { v = random.next(v.size()).cwiseAbs() * 10.0; };
  positive(weights.rows.inequality());
  positive(weights.rows.s());
  positive(weights.rows.t());
  if (with_zeros) {
    for (Eigen::Index i = 0; i < weights.rows.inequality().size(); i += 2) weights.rows.inequality()[i] = 0.0;
    for (Eigen::Index i = 0; i < weights.rows.t().size(); i += 2) weights.rows.t()[i] = 0.0;
  }
  const Vector angle = random.next(p.pairs()) * 3.0;
  weights.cosine = angle.array().cos();
  weights.sine = angle.array().sin();
  return weights;
}

void expect_solves(Kkt& kkt, const ScaledProblem& p, const RowWeights& weights) {
  ASSERT_TRUE(kkt.factor(weights)) << kkt.name();
  RandomVectors random(11);
  Vector x = random.next(p.variables());
  Vector y = random.next(p.equalities());
  Vector right(x.size() + y.size());
  right << x, y;
  const Vector expected = testing::dense_solve(dense_system(p, weights), right);
  Vector once_x = x, once_y = y;
  ASSERT_TRUE(kkt.solve(x, y));
  Vector found(x.size() + y.size());
  found << x, y;
  EXPECT_LT(max_abs(found - expected), 1e-10 * (1.0 + max_abs(expected))) << kkt.name();
  ASSERT_TRUE(kkt.solve_once(once_x, once_y));
  found << once_x, once_y;
  EXPECT_LT(max_abs(found - expected), 1e-8 * (1.0 + max_abs(expected))) << kkt.name();
}

// Each of them another multiple of one right-hand side.
void expect_solves_many(Kkt& kkt, const ScaledProblem& p, const RowWeights& weights) {
  ASSERT_TRUE(kkt.factor(weights)) << kkt.name();
  RandomVectors random(12);
  Vector x = random.next(p.variables()), y = random.next(p.equalities());
  const auto repeated = [](const Vector& one, Index count) {
    Vector all(one.size() * count);
    for (Eigen::Index i = 0; i < one.size(); ++i) {
      for (Index k = 0; k < count; ++k) all[i * count + k] = (k + 1.0) * one[i];
    }
    return all;
  };
  for (const Index count : {1, 2, 4, 8}) {
    SCOPED_TRACE(count);
    Vector many_x = repeated(x, count), many_y = repeated(y, count);
    ASSERT_TRUE(kkt.solve_many(many_x.data(), many_y.data(), count));
    Vector once_x = x, once_y = y;
    ASSERT_TRUE(kkt.solve_once(once_x, once_y));
    const double size = count * (1.0 + max_abs(once_x) + max_abs(once_y));
    EXPECT_LT(max_abs(many_x - repeated(once_x, count)), 1e-11 * size) << kkt.name();
    EXPECT_LT(max_abs(many_y - repeated(once_y, count)), 1e-11 * size) << kkt.name();
  }
}

// Memory that others had is not zero: what an engine does not set must not weigh.
TEST(RowWeights, WeighNothingAsMade) {
  const ScaledProblem p = scale(Problem::create(random_problem({}, 1).view()).value(), 0);
  const Eigen::Index rows = p.layout.size();
  { const Vector before = Vector::Constant(rows, 1e6); }
  EXPECT_EQ(RowWeights(p).rows.all, Vector::Zero(rows));
}

TEST(Kkt, EveryBackendSolvesTheSystemAndTheNextWithTheSamePattern) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const OwnedProblem problem =
        random_problem({.variables = 30, .equalities = 5, .inequalities = 12, .pairs = 9}, seed);
    const ScaledProblem p = scaled(problem);
    for (const auto& kkt : backends(p)) {
      expect_solves(*kkt, p, random_weights(p, 1, false));
      expect_solves(*kkt, p, random_weights(p, 2, true));
      expect_solves(*kkt, p, random_weights(p, 3, false));
      expect_solves_many(*kkt, p, random_weights(p, 4, true));
    }
  }
}

TEST(Kkt, EveryBackendSolvesEveryShape) {
  for (const auto& sizes : all_shapes()) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const ScaledProblem p = scaled(random_problem(sizes, seed));
      for (const auto& kkt : backends(p)) expect_solves(*kkt, p, random_weights(p, 4, seed % 2 == 0));
    }
  }
}

TEST(Kkt, WeightsOfZeroDropTheirRows) {
  const ScaledProblem p = scaled(random_problem({.variables = 20, .equalities = 4}, 2));
  for (const auto& kkt : backends(p)) {
    RowWeights weights = random_weights(p, 5, false);
    weights.rows.inequality().setZero();
    weights.rows.s().setZero();
    weights.rows.t().setZero();
    expect_solves(*kkt, p, weights);
  }
}

TEST(Kkt, NegativeWeightsThatLeaveConvexityAreSolvedWith) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const ScaledProblem p = scaled(random_problem({.variables = 20, .equalities = 4}, seed));
    RowWeights weights = random_weights(p, static_cast<unsigned>(seed), false);
    weights.delta = 1.0;
    weights.rows.t() *= -0.01;
    for (const auto& kkt : backends(p)) expect_solves(*kkt, p, weights);
  }
}

TEST(Kkt, SurvivesTheWeightsOfAnExactActiveSet) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const ScaledProblem p =
        scaled(random_problem({.variables = 20, .equalities = 3, .inequalities = 4, .pairs = 3}, seed));
    RowWeights weights(p);
    weights.rho = 1e8;
    weights.delta = 1e-8;
    weights.rows.inequality().setConstant(1e8);
    weights.rows.s().setConstant(1e8);
    weights.rows.t().setZero();
    weights.cosine.setOnes();
    weights.sine.setZero();
    const Eigen::MatrixXd K = dense_system(p, weights);
    for (const auto& kkt : backends(p)) {
      ASSERT_TRUE(kkt->factor(weights)) << kkt->name();
      // A right-hand side whose solution is known and of moderate size.
      RandomVectors random(seed);
      const Vector x = random.next(p.variables());
      const Vector y = random.next(p.equalities());
      Vector expected(x.size() + y.size());
      expected << x, y;
      const Vector right = K * expected;
      Vector found_x = right.head(x.size());
      Vector found_y = right.tail(y.size());
      ASSERT_TRUE(kkt->solve(found_x, found_y));
      EXPECT_LT(max_abs(found_x - x), 1e-6) << kkt->name() << " seed " << seed;
    }
  }
}

TEST(Kkt, AFactorizationDoesNotDependOnTheOnesBefore) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const ScaledProblem p =
        scaled(random_problem({.variables = 30, .equalities = 5, .inequalities = 12, .pairs = 9}, seed));
    const RowWeights other = random_weights(p, 7, true);
    RowWeights hopeless = random_weights(p, 8, false);
    hopeless.rows.t() *= -100.0;
    const RowWeights wanted = random_weights(p, 9, false);
    const auto used = backends(p);
    const auto fresh = backends(p);
    for (std::size_t i = 0; i < used.size(); ++i) {
      EXPECT_TRUE(used[i]->factor(other));
      EXPECT_FALSE(used[i]->factor(hopeless));
      Vector solutions[2];
      std::size_t side = 0;
      for (Kkt* kkt : {used[i].get(), fresh[i].get()}) {
        ASSERT_TRUE(kkt->factor(wanted));
        Vector x = Vector::LinSpaced(p.variables(), -1.0, 2.0);
        Vector y = Vector::LinSpaced(p.equalities(), 1.0, 3.0);
        ASSERT_TRUE(kkt->solve(x, y));
        solutions[side++] = x;
      }
      EXPECT_TRUE((solutions[0].array() == solutions[1].array()).all()) << used[i]->name();
    }
  }
}

TEST(Kkt, ANegativeWeightOnAKeptRowIsReportedFromANegativePivotOfTheRest) {
  // H = q + k for one variable and one pair whose L is 1: convex while q + k > 0, however the row is treated.
  OwnedProblem problem;
  problem.g = {0.0};
  Triplets one, none;
  one.add(0, 0, 1.0);
  problem.Q = compress(1, 1, one, "Q").value();
  problem.L = compress(1, 1, one, "L").value();
  problem.R = compress(1, 1, none, "R").value();
  problem.l = problem.r = {0.0};
  const ScaledProblem p = scaled(problem, 0);
  RowWeights weights(p);
  weights.cosine.setOnes();
  weights.sine.setZero();
  weights.rows.t().setZero();
  for (const double k : {-3.0, -1.5, -0.5, 0.0, 0.5}) {
    weights.rows.s().setConstant(k);
    for (const auto& kkt : backends(p)) EXPECT_EQ(kkt->factor(weights), 1.0 + k > 0.0) << kkt->name() << k;
  }
}

TEST(Kkt, NegativeWeightsAreWrongInertiaOnlyWhenTheyOutweighTheRest) {
  int right = 0;
  int wrong = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const OwnedProblem problem = random_problem({}, seed);
    const ScaledProblem p = scaled(problem);
    RowWeights weights = random_weights(p, static_cast<unsigned>(seed), false);
    weights.rows.t() *= seed % 2 == 0 ? -1.0 : -0.001;
    const Eigen::MatrixXd K = dense_system(p, weights);
    const Vector eigenvalues = testing::eigenvalues(K);
    const bool expected = (eigenvalues.array() > 0.0).count() == p.variables();
    (expected ? right : wrong) += 1;
    for (const auto& kkt : backends(p))
      EXPECT_EQ(kkt->factor(weights), expected) << kkt->name() << " seed " << seed;
  }
  EXPECT_GT(right, 3);
  EXPECT_GT(wrong, 3);
}

TEST(Kkt, DenseRowsAreNotMultipliedOut) {
  // A chain with one inequality over all variables: condensed it would fill the matrix.
  const Index n = 400;
  OwnedProblem problem;
  problem.g.assign(n, 1.0);
  Triplets hessian, row;
  for (Index i = 0; i < n; ++i) {
    hessian.add(i, i, 2.0);
    row.add(0, i, 1.0);
    if (i > 0) {
      hessian.add(i, i - 1, -0.5);
      hessian.add(i - 1, i, -0.5);
    }
  }
  problem.Q = compress(n, n, hessian, "Q").value();
  problem.C = compress(1, n, row, "C").value();
  problem.d = {1.0};
  const ScaledProblem p = scaled(problem);
  EXPECT_EQ(make_kkt(p)->name(), "sparse, dense rows kept");
}

TEST(Kkt, FullProblemsTakeTheDenseBackend) {
  const OwnedProblem problem =
      random_problem({.variables = 80, .equalities = 0, .inequalities = 40, .pairs = 40, .density = 1.0}, 1);
  const ScaledProblem p = scaled(problem);
  EXPECT_EQ(make_kkt(p)->name(), "dense");
}

}  // namespace
}  // namespace marble
