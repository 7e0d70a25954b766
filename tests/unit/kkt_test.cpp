#include "kkt.h"

#include <gtest/gtest.h>

#include "dense_kkt.h"
#include "dense_system.h"
#include "sparse_kkt.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using testing::dense;
using testing::random_problem;

RowWeights random_weights(const ScaledProblem& p, unsigned seed, bool with_zeros) {
  std::srand(seed);
  RowWeights weights(p);
  weights.rho = 20.0;
  weights.delta = 0.01;
  const auto positive = [](Vector& v) { v = Vector::Random(v.size()).cwiseAbs() * 10.0; };
  positive(weights.inequality);
  positive(weights.first);
  positive(weights.second);
  if (with_zeros) {
    for (Eigen::Index i = 0; i < weights.inequality.size(); i += 2) weights.inequality[i] = 0.0;
    for (Eigen::Index i = 0; i < weights.second.size(); i += 2) weights.second[i] = 0.0;
  }
  const Vector angle = Vector::Random(p.pairs()) * 3.0;
  weights.cosine = angle.array().cos();
  weights.sine = angle.array().sin();
  return weights;
}

Eigen::MatrixXd dense_system(const ScaledProblem& p, const RowWeights& weights) {
  const Index n = p.variables(), n_e = p.equalities();
  const Eigen::MatrixXd A = dense(p.A), C = dense(p.C), L = dense(p.L), R = dense(p.R);
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n + n_e, n + n_e);
  Eigen::MatrixXd H = dense(p.Q) + weights.delta * Eigen::MatrixXd::Identity(n, n);
  H += C.transpose() * weights.inequality.asDiagonal() * C;
  for (Index i = 0; i < p.pairs(); ++i) {
    const Eigen::RowVectorXd first = weights.cosine[i] * L.row(i) + weights.sine[i] * R.row(i);
    const Eigen::RowVectorXd second = weights.sine[i] * L.row(i) - weights.cosine[i] * R.row(i);
    H += weights.first[i] * first.transpose() * first + weights.second[i] * second.transpose() * second;
  }
  K.topLeftCorner(n, n) = H;
  K.topRightCorner(n, n_e) = A.transpose();
  K.bottomLeftCorner(n_e, n) = A;
  K.bottomRightCorner(n_e, n_e).diagonal().setConstant(-1.0 / weights.rho);
  return K;
}

std::vector<std::unique_ptr<Kkt>> backends(const ScaledProblem& p) {
  std::vector<std::unique_ptr<Kkt>> all;
  all.push_back(std::make_unique<SparseKkt>(p, KeptRows::none));
  all.push_back(std::make_unique<SparseKkt>(p, KeptRows::dense));
  all.push_back(std::make_unique<SparseKkt>(p, KeptRows::all));
  all.push_back(std::make_unique<DenseKkt>(p));
  return all;
}

void expect_solves(Kkt& kkt, const ScaledProblem& p, const RowWeights& weights) {
  ASSERT_TRUE(kkt.factor(weights)) << kkt.name();
  Vector x = Vector::Random(p.variables());
  Vector y = Vector::Random(p.equalities());
  Vector right(x.size() + y.size());
  right << x, y;
  const Vector expected = dense_system(p, weights).fullPivLu().solve(right);
  kkt.solve(x, y);
  Vector found(x.size() + y.size());
  found << x, y;
  EXPECT_LT(max_abs(found - expected), 1e-10 * (1.0 + max_abs(expected))) << kkt.name();
}

TEST(Kkt, EveryBackendSolvesTheSystemAndTheNextWithTheSamePattern) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const OwnedProblem problem =
        random_problem({.variables = 30, .equalities = 5, .inequalities = 12, .pairs = 9}, seed);
    const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
    for (const auto& kkt : backends(p)) {
      expect_solves(*kkt, p, random_weights(p, 1, false));
      expect_solves(*kkt, p, random_weights(p, 2, true));
      expect_solves(*kkt, p, random_weights(p, 3, false));
    }
  }
}

TEST(Kkt, NegativeWeightsAreWrongInertiaOnlyWhenTheyOutweighTheRest) {
  int right = 0;
  int wrong = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const OwnedProblem problem = random_problem({}, seed);
    const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
    RowWeights weights = random_weights(p, static_cast<unsigned>(seed), false);
    weights.second *= seed % 2 == 0 ? -1.0 : -0.001;
    const Eigen::MatrixXd K = dense_system(p, weights);
    const Vector eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(K).eigenvalues();
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
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
  EXPECT_EQ(make_kkt(p)->name(), "sparse, dense rows kept");
}

TEST(Kkt, FullProblemsTakeTheDenseBackend) {
  const OwnedProblem problem =
      random_problem({.variables = 80, .equalities = 0, .inequalities = 40, .pairs = 40, .density = 1.0}, 1);
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
  EXPECT_EQ(make_kkt(p)->name(), "dense");
}

}  // namespace
}  // namespace marble
