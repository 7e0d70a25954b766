#include "scaling.h"

#include <gtest/gtest.h>

#include "residual.h"
#include "support/independent_check.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using testing::random_problem;

Iterate random_iterate(const ScaledProblem& p, unsigned seed) {
  Iterate x(p);
  std::srand(seed);
  x.all.setRandom();
  return x;
}

TEST(Scaling, RowsAndColumnsEndNearNormOne) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    OwnedProblem problem = random_problem({}, seed);
    for (double& value : problem.A.values) value *= 1e4;
    for (double& value : problem.L.values) value *= 1e-3;
    const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
    for (const RowMatrix* matrix : {&p.A, &p.C, &p.L, &p.R}) {
      for (Index row = 0; row < matrix->rows; ++row) {
        double norm = 0.0;
        for (Index k = matrix->row_pointers[row]; k < matrix->row_pointers[row + 1]; ++k) {
          norm = std::max(norm, std::abs(matrix->values[k]));
        }
        EXPECT_NEAR(norm, 1.0, 0.1);
      }
    }
  }
}

TEST(Scaling, ViolationsAreInTheUsersUnits) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem problem = random_problem({}, seed);
    const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
    const Iterate x = random_iterate(p, static_cast<unsigned>(seed));
    Images images(p);
    images.evaluate(p, x);
    Solution solution;
    const Vector z = x.z().cwiseProduct(p.variable_scale);
    solution.z.assign(z.data(), z.data() + z.size());
    solution.equality_multipliers.resize(problem.b.size());
    solution.inequality_multipliers.resize(problem.d.size());
    solution.complementarity_multipliers_L.resize(problem.l.size());
    solution.complementarity_multipliers_R.resize(problem.r.size());
    const testing::Verdict verdict = testing::judge(problem.view(), solution);
    const Violations v = violations(p, images);
    EXPECT_NEAR(v.equality, verdict.equality, 1e-12 * (1.0 + verdict.equality));
    EXPECT_NEAR(v.inequality, verdict.inequality, 1e-12 * (1.0 + verdict.inequality));
    EXPECT_NEAR(v.complementarity, verdict.complementarity, 1e-12 * (1.0 + verdict.complementarity));
    EXPECT_NEAR(images.objective / p.cost_scale + p.c0, verdict.objective,
                1e-11 * (1.0 + std::abs(verdict.objective)));
  }
}

TEST(Scaling, NoPassesLeaveTheDataAsTheyAre) {
  const OwnedProblem problem = random_problem({}, 3);
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 0);
  EXPECT_EQ(p.cost_scale, 1.0);
  EXPECT_TRUE(p.variable_scale.isOnes());
  EXPECT_EQ(std::vector<double>(p.g.begin(), p.g.end()), problem.g);
  EXPECT_EQ(std::vector<double>(p.b.begin(), p.b.end()), problem.b);
}

TEST(Scaling, ZeroRowsAndColumnsKeepScaleOne) {
  OwnedProblem problem;
  problem.g = {1.0, 0.0};
  Triplets entries;
  entries.add(0, 0, 1e6);
  problem.C = compress(2, 2, entries, "C").value();  // row 1 and column 1 are empty
  problem.d = {0.0, 1.0};
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
  EXPECT_EQ(p.inequality_scale[1], 1.0);
  EXPECT_EQ(p.variable_scale[1], 1.0);
  EXPECT_TRUE(p.variable_scale.allFinite());
}

TEST(Scaling, ExtremeMagnitudesStayFinite) {
  OwnedProblem problem = random_problem({}, 5);
  for (double& value : problem.A.values) value *= 1e150;
  for (double& value : problem.C.values) value *= 1e-150;
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
  EXPECT_TRUE(p.variable_scale.allFinite() && p.equality_scale.allFinite() && p.inequality_scale.allFinite());
  EXPECT_GT(p.variable_scale.minCoeff(), 0.0);
}

}  // namespace
}  // namespace marble
