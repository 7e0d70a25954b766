#include "model/scaling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dense_system.h"
#include "random_setting.h"
#include "row_parts.h"
#include "support/independent_check.h"

namespace marble {
namespace {

using testing::random_problem;

Iterate random_iterate(const ScaledProblem& p, unsigned seed) {
  Iterate x(p);
  testing::RandomVectors(seed).fill(x.all);
  return x;
}

TEST(Scaling, RowsAndColumnsEndNearNormOne) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    OwnedProblem problem = random_problem({}, seed);
    for (double& value : problem.A.values) value *= 1e4;
    for (double& value : problem.L.values) value *= 1e-3;
    const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
    for (const RowMatrix* matrix : {&p.A, &p.rows}) {
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

void expect_same_scales(const ScaledProblem& found, const ScaledProblem& expected) {
  EXPECT_EQ(found.variable_scale, expected.variable_scale);
  EXPECT_EQ(found.equality_scale, expected.equality_scale);
  EXPECT_EQ(found.row_scale, expected.row_scale);
  EXPECT_EQ(found.cost_scale, expected.cost_scale);
}

// 0.1 + 0.1 + 0.1 - 0.3 is not 0: what rounding leaves of a sum has no units.
TEST(Scaling, TakesNoUnitsFromWhatRoundingLeft) {
  OwnedProblem problem = random_problem({}, 1);
  problem.g[0] *= 1e4;  // the units need a fit
  problem.d[0] = 0.0;
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
  problem.d[0] = 0.1 + 0.1 + 0.1 - 0.3;
  const ScaledProblem noisy = scale(Problem::create(problem.view()).value(), 10);
  expect_same_scales(noisy, p);
}

// As at a robot's rest pose, where all constants are what rounding left.
TEST(Scaling, TakesNoUnitsFromConstantsFarBelowTheirRows) {
  OwnedProblem problem = random_problem({}, 1);
  problem.g[0] *= 1e4;
  std::ranges::fill(problem.b, 0.0);
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
  for (std::size_t i = 0; i < problem.b.size(); ++i) problem.b[i] = 1e-15 * static_cast<double>(i + 1);
  const ScaledProblem noisy = scale(Problem::create(problem.view()).value(), 10);
  expect_same_scales(noisy, p);
}

// min z²/2 + z, z + 2^40 = 0, and the same with z = small z': only in the user's units is the constant noise.
TEST(Scaling, TakesUnitsFromConstantsThatAreSmallInTheUsersUnitsAlone) {
  double constants[2] = {};
  for (const double small : {1.0, std::ldexp(1.0, -80)}) {
    OwnedProblem problem;
    problem.Q = {1, 1, {0, 1}, {0}, {1.0 / (small * small)}};
    problem.A = {1, 1, {0, 1}, {0}, {1.0 / small}};
    problem.g = {1.0 / small}, problem.b = {std::ldexp(1.0, 40)};
    constants[small < 1.0] = scale(Problem::create(problem.view()).value(), 10).b[0];
  }
  EXPECT_LT(constants[0], std::ldexp(1.0, 35));  // they count
  EXPECT_NEAR(constants[1] / constants[0], 1.0, 0.5);
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

Eigen::MatrixXd dense(const SparseMatrix& m) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(m.rows, m.columns);
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      out(m.row_indices[k], j) = m.values[k];
  }
  return out;
}

Vector vector(const std::vector<double>& values) {
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

TEST(Scaling, NoPassesLeaveTheDataAsTheyAre) {
  for (const auto& sizes : testing::all_shapes()) {
    const OwnedProblem problem = random_problem(sizes, 3);
    const ScaledProblem p = testing::scaled(problem, 0);
    EXPECT_EQ(p.cost_scale, 1.0);
    EXPECT_TRUE(p.variable_scale.isOnes(0.0) && p.equality_scale.isOnes(0.0));
    EXPECT_EQ(testing::dense(p.Q), dense(problem.Q));
    EXPECT_EQ(testing::dense(p.A), dense(problem.A));
    EXPECT_EQ(testing::dense(C_of(p)), dense(problem.C));
    EXPECT_EQ(testing::dense(L_of(p)), dense(problem.L));
    EXPECT_EQ(testing::dense(R_of(p)), dense(problem.R));
    EXPECT_EQ(p.g, vector(problem.g));
    EXPECT_EQ(p.b, vector(problem.b));
    EXPECT_EQ(d_of(p), vector(problem.d));
    EXPECT_EQ(l_of(p), vector(problem.l));
    EXPECT_EQ(r_of(p), vector(problem.r));
    EXPECT_EQ(p.c0, problem.c0);
  }
}

TEST(Scaling, UndoneTheImagesAreThoseOfTheUsersData) {
  for (const auto& sizes : testing::all_shapes()) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      OwnedProblem problem = random_problem(sizes, seed);
      for (double& value : problem.A.values) value *= 1e3;
      for (double& value : problem.R.values) value *= 1e-4;
      for (double& value : problem.g) value *= 1e5;
      const ScaledProblem p = testing::scaled(problem);
      const Iterate x = random_iterate(p, static_cast<unsigned>(seed));
      Images images(p);
      images.evaluate(p, x);
      const Vector z = x.z().cwiseProduct(p.variable_scale);
      const auto expect_same = [](const Vector& unscaled, const Vector& direct) {
        EXPECT_LT(max_abs(unscaled - direct), 1e-12 * (1.0 + max_abs(direct)));
      };
      expect_same(images.equality.cwiseQuotient(p.equality_scale), dense(problem.A) * z + vector(problem.b));
      expect_same(images.rows.inequality().cwiseQuotient(inequality_scale_of(p)),
                  dense(problem.C) * z + vector(problem.d));
      expect_same(images.rows.s().cwiseQuotient(left_scale_of(p)), dense(problem.L) * z + vector(problem.l));
      expect_same(images.rows.t().cwiseQuotient(right_scale_of(p)), dense(problem.R) * z + vector(problem.r));
      const Vector gradient = dense(problem.Q) * z + vector(problem.g);
      expect_same(images.gradient.cwiseQuotient(p.variable_scale) / p.cost_scale, gradient);
      // The multipliers' own units: stationarity of the user's problem with y = E_A ȳ / c and so on.
      const double cost = 1.0 / p.cost_scale;
      Vector stationarity = gradient;
      const auto add = [&](const SparseMatrix& m, const Vector& lambda, const Vector& row_scale) {
        if (m.rows > 0) stationarity += cost * (dense(m).transpose() * lambda.cwiseProduct(row_scale));
      };
      add(problem.A, x.y(), p.equality_scale);
      add(problem.C, x.lambda_w(), inequality_scale_of(p));
      add(problem.L, x.lambda_L(), left_scale_of(p));
      add(problem.R, x.lambda_R(), right_scale_of(p));
      expect_same(cost * images.stationarity.cwiseQuotient(p.variable_scale), stationarity);
    }
  }
}

TEST(Scaling, ColumnsEndNearNormOneToo) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    OwnedProblem problem = random_problem({}, seed);
    for (double& value : problem.Q.values) value *= 1e-5;
    const ScaledProblem p = testing::scaled(problem);
    Vector norm = Vector::Zero(p.variables());
    for (const Eigen::MatrixXd& m :
         {Eigen::MatrixXd(testing::dense(p.Q) / p.cost_scale), testing::dense(p.A), testing::dense(C_of(p)),
          testing::dense(L_of(p)), testing::dense(R_of(p))}) {
      for (Index j = 0; j < p.variables(); ++j) norm[j] = std::max(norm[j], max_abs(m.col(j)));
    }
    EXPECT_LT(norm.maxCoeff(), 1.1) << seed;
    EXPECT_GT(norm.minCoeff(), 0.9) << seed;
  }
}

TEST(Scaling, BringsTheCostToSizeOne) {
  for (const double size : {1e-6, 1.0, 1e6}) {
    OwnedProblem problem = random_problem({}, 2);
    for (double& value : problem.Q.values) value *= size;
    for (double& value : problem.g) value *= size;
    const ScaledProblem p = testing::scaled(problem);
    double column_norms = 0.0;
    for (Index j = 0; j < p.variables(); ++j) column_norms += max_abs(testing::dense(p.Q).col(j));
    EXPECT_NEAR(std::max(column_norms / p.variables(), max_abs(p.g)), 1.0, 1e-12) << size;
  }
}

TEST(Scaling, ZeroRowsAndColumnsKeepScaleOne) {
  OwnedProblem problem;
  problem.g = {1.0, 0.0};
  Triplets entries;
  entries.add(0, 0, 1e6);
  problem.C = compress(2, 2, entries, "C").value();  // row 1 and column 1 are empty
  problem.d = {0.0, 1.0};
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
  EXPECT_EQ(inequality_scale_of(p)[1], 1.0);
  EXPECT_EQ(p.variable_scale[1], 1.0);
  EXPECT_TRUE(p.variable_scale.allFinite());
}

TEST(Scaling, ExtremeMagnitudesStayFinite) {
  OwnedProblem problem = random_problem({}, 5);
  for (double& value : problem.A.values) value *= 1e150;
  for (double& value : problem.C.values) value *= 1e-150;
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 10);
  EXPECT_TRUE(p.variable_scale.allFinite() && p.equality_scale.allFinite() &&
              inequality_scale_of(p).allFinite());
  EXPECT_GT(p.variable_scale.minCoeff(), 0.0);
}

}  // namespace
}  // namespace marble
