#include "branch/bordered_inverse.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>
#include <vector>

namespace marble {
namespace {

constexpr Index kMost = 20;

// A matrix of which the inverse has some rows and columns, in an order that it determines itself.
struct Parts {
  explicit Parts(unsigned seed) : random(seed), all(kMost, kMost), inverse(kMost) {
    for (double& entry : all.reshaped()) entry = normal(random);
  }
  void add(Index part) {
    held.push_back(part);
    inverse.append([&](Index a, Index b) { return all(held[a], held[b]); });
  }
  void remove(std::size_t k) {
    inverse.remove(static_cast<Index>(k));
    held[k] = held.back();
    held.pop_back();
  }
  [[nodiscard]] Eigen::MatrixXd matrix() const {
    const auto n = std::ssize(held);
    return Eigen::MatrixXd::NullaryExpr(n, n, [&](auto a, auto b) { return all(held[a], held[b]); });
  }
  // Relative to what LU with pivoting leaves.
  void expect_solves() {
    if (held.empty()) return;
    const Eigen::MatrixXd now = matrix();
    Eigen::VectorXd x(now.rows());
    for (double& entry : x) entry = normal(random);
    const Eigen::VectorXd right_side = x;
    ASSERT_TRUE(inverse.solve(x));
    const double size = now.cwiseAbs().sum() * (1.0 + x.cwiseAbs().maxCoeff());
    EXPECT_LE((now * x - right_side).cwiseAbs().maxCoeff(), 1e-12 * size) << held.size() << " rows";
  }

  std::mt19937 random;
  std::normal_distribution<double> normal;
  Eigen::MatrixXd all;
  BorderedInverse inverse;
  std::vector<Index> held;
};

TEST(BorderedInverse, SolvesWhileRowsComeAndGo) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    Parts p(seed);
    for (Index part = 0; part < kMost; ++part) {
      p.add(part);
      p.expect_solves();
    }
    while (!p.held.empty()) {
      p.remove(p.random() % p.held.size());
      p.expect_solves();
    }
    p.add(3);
    p.expect_solves();
  }
}

// Neither the first row alone nor the last ones have an inverse.
TEST(BorderedInverse, SolvesWhereAPartOfTheMatrixIsSingular) {
  Parts p(1);
  p.all(0, 0) = 0.0;
  p.add(0);
  Eigen::VectorXd x = Eigen::VectorXd::Ones(1);
  EXPECT_FALSE(p.inverse.solve(x) && std::isfinite(x[0]));
  p.add(1);
  p.expect_solves();
  p.add(2);
  p.remove(2);
  p.expect_solves();
}

TEST(BorderedInverse, KeepsRowsOfDifferentSizesApart) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    Parts p(seed);
    for (Index a = 0; a < kMost; ++a) p.all.row(a) *= a % 2 == 0 ? 1.0 : 1e8;
    for (Index part = 0; part < kMost; ++part) p.add(part);
    p.remove(4);
    const Eigen::MatrixXd now = p.matrix();
    Eigen::VectorXd x = Eigen::VectorXd::Ones(now.rows());
    ASSERT_TRUE(p.inverse.solve(x));
    const Eigen::VectorXd left = (now * x).array() - 1.0;
    const Eigen::VectorXd sizes = (now.cwiseAbs() * x.cwiseAbs()).array() + 1.0;
    EXPECT_LE(left.cwiseQuotient(sizes).cwiseAbs().maxCoeff(), 1e-12);
  }
}

}  // namespace
}  // namespace marble
