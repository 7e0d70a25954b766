// A convex QP of 800 variables whose diagonal Q is singular was solved 1.0e-6 off its optimum after 133
// factorizations, with a KKT residual of 1.5e-11; 5 of 100 random ones like it were up to 4e-5 off.
//
// Mehrotra's method had converged to κ = 1e-13 when a factorization failed: weights of 1/κ left nothing of
// flat directions but rounding. Its point was dropped, and the path's was within the tolerances at κ = 1e-7.
// Now the proximal term is raised there, a method that has converged gives its own point where no choice of
// rows does, and kkt_residual includes the complementary slackness of inequalities.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "marble/solver.h"

namespace marble {
namespace {

double product(const SparseMatrix& matrix, const std::vector<double>& x, const std::vector<double>& y) {
  double sum = 0.0;
  for (std::size_t j = 0; j < x.size(); ++j)
    for (auto k = static_cast<std::size_t>(matrix.column_pointers[j]);
         k < static_cast<std::size_t>(matrix.column_pointers[j + 1]); ++k)
      sum += y[static_cast<std::size_t>(matrix.row_indices[k])] * matrix.values[k] * x[j];
  return sum;
}

double dot(const std::vector<double>& x, const std::vector<double>& y) {
  double sum = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * y[i];
  return sum;
}

// Half of the entries of Q's diagonal are 0, rows have four entries, half of the inequalities hold with
// equality at some point of the box.
OwnedProblem flat_problem(std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> normal;
  const auto n = static_cast<Index>(500.0 + 350.0 * (uniform(engine) + 1.0));
  OwnedProblem p;
  Triplets Q, A, C;
  for (Index j = 0; j < n; ++j)
    if (uniform(engine) > 0.0) Q.add(j, j, std::pow(10.0, 2.0 * uniform(engine)));
  std::vector<double> z(static_cast<std::size_t>(n));
  for (double& entry : z) entry = uniform(engine);
  const double size = std::pow(10.0, 1.5 * uniform(engine));
  for (Index j = 0; j < n; ++j) p.g.push_back(size * normal(engine));
  const auto add_row = [&](Triplets& rows, Index row) {
    double value = 0.0;
    for (int k = 0; k < 4; ++k) {
      const Index column = std::min(n - 1, static_cast<Index>((uniform(engine) + 1.0) * n / 2.0));
      const double entry = normal(engine);
      rows.add(row, column, entry);
      value += entry * z[static_cast<std::size_t>(column)];
    }
    return -value;
  };
  const Index equalities = n / 4, inequalities = n / 2;
  for (Index i = 0; i < equalities; ++i) p.b.push_back(add_row(A, i));
  for (Index i = 0; i < inequalities; ++i) {
    const double offset = add_row(C, i);
    p.d.push_back(offset + (uniform(engine) > 0.0 ? 0.0 : std::abs(normal(engine))));
  }
  for (Index j = 0; j < n; ++j) {
    for (const double sign : {1.0, -1.0}) {
      C.add(static_cast<Index>(p.d.size()), j, sign);
      p.d.push_back(seed % 2 == 0 ? 2.0 : 1.0);
    }
  }
  p.Q = compress(n, n, Q, "Q").value();
  p.A = compress(equalities, n, A, "A").value();
  p.C = compress(static_cast<Index>(p.d.size()), n, C, "C").value();
  return p;
}

// Seeds 7, 42, 82 and 89 were wrong, 2 and 49 took more than 150 factorizations.
TEST(FlatQuadratic, IsSolvedToItsDualInFewFactorizations) {
  for (const std::uint64_t seed : {1, 2, 3, 7, 42, 49, 51, 82, 86, 89}) {
    const OwnedProblem p = flat_problem(seed);
    const Solution s = Solver::create(Problem::create(p.view()).value()).value().solve().value();
    const std::string where = std::to_string(seed) + ": " + s.detail;
    EXPECT_EQ(s.status, Status::solved) << where;
    EXPECT_LE(s.factorizations, 30) << where;
    EXPECT_LE(std::max(s.violations.equality, s.violations.inequality), 1e-9) << where;
    const double curvature = product(p.Q, s.z, s.z);
    const double dual =
        dot(p.b, s.equality_multipliers) - dot(p.d, s.inequality_multipliers) - 0.5 * curvature;
    EXPECT_NEAR(s.objective, dual, 1e-9 * (1.0 + std::abs(dual))) << where;
    EXPECT_GE(*std::ranges::min_element(s.inequality_multipliers), -1e-9) << where;
  }
}

TEST(FlatQuadratic, ResidualIncludesTheSlacknessOfInequalities) {
  const OwnedProblem p = flat_problem(7);
  Options options;
  options.path = Path::paper;
  options.polish = false;
  const Solution s = Solver::create(Problem::create(p.view()).value(), options).value().solve().value();
  double slackness = 0.0;
  for (std::size_t i = 0; i < p.d.size(); ++i) {
    std::vector<double> row(p.d.size(), 0.0);
    row[i] = s.inequality_multipliers[i];
    slackness = std::max(slackness, std::abs(product(p.C, s.z, row) + p.d[i] * row[i]));
  }
  EXPECT_GT(slackness, 0.0);
  EXPECT_GE(s.kkt_residual, (1.0 - 1e-6) * slackness);
}

}  // namespace
}  // namespace marble
