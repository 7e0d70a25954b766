// What a local search relies on of the elastic version of a branch.
#include "branch/elastic_relaxation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "branch/branch_engines.h"
#include "support/random_problem.h"
#include "support/small_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::row_and_pair;
using testing::Rows;
using testing::Workbench;
using Begin = ElasticRelaxation::Rows;

constexpr int kBudget = 100;

// The elastic objective in plain loops: f + ½δ‖z − anchor‖² + ½ρ Σ violation², with δ as solve() has it.
double elastic(const Workbench& w, const WorkingSet& set, double rho, const Vector& anchor, const Vector& z) {
  Iterate x(w.problem);
  x.z() = z;
  const Images images = w.images(x);
  double violation = images.equality.squaredNorm();
  const auto below = [](double value) { return std::min(0.0, value) * std::min(0.0, value); };
  for (const double value : images.rows.inequality()) violation += below(value);
  for (Eigen::Index i = 0; i < images.rows.s().size(); ++i) {
    const bool s_side = set.s_fixed[static_cast<std::size_t>(i)] != 0;
    violation += s_side ? images.rows.s()[i] * images.rows.s()[i] + below(images.rows.t()[i])
                        : images.rows.t()[i] * images.rows.t()[i] + below(images.rows.s()[i]);
  }
  const double delta = rho >= 1e8 ? 1e-8 : 1e-6;
  return images.objective + 0.5 * delta * (z - anchor).squaredNorm() + 0.5 * rho * violation;
}

TEST(ElasticRelaxation, ItsSolutionIsTheMinimumOfThePenaltyFunction) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    BranchEngines branch(w.problem, *w.kkt);
    branch.point.start_from_point(w.zero());
    for (const double rho : {10.0, 1e3, 1e6}) {
      ASSERT_TRUE(branch.elastic.solve(w.run, rho, Begin::violated, kBudget)) << seed;
      EXPECT_EQ(branch.elastic.rho(), rho);
      const Vector z = branch.point.x.z();
      const double least = elastic(w, branch.point.set, rho, w.zero(), z);
      EXPECT_NEAR(branch.elastic.objective(), least, 1e-8 * (1.0 + std::abs(least))) << seed;
      for (Index k = 0; k < w.problem.variables(); ++k) {
        for (const double step : {1e-3, -1e-3}) {
          const Vector near = z + step * Vector::Unit(z.size(), k);
          EXPECT_GE(elastic(w, branch.point.set, rho, w.zero(), near), least - 1e-10)
              << seed << " rho " << rho;
        }
      }
      const Images images = w.images(branch.point.x);
      EXPECT_LE(max_abs(branch.point.x.y() - rho * images.equality), 1e-7 * rho) << "λ = ρ · violation";
    }
  }
}

TEST(ElasticRelaxation, AStifferOneCostsMoreAndEndsAtTheExactOne) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    BranchEngines branch(w.problem, *w.kkt);
    branch.point.start_from_point(w.zero());
    const WorkingSet first = branch.point.set;
    double before = -std::numeric_limits<double>::infinity();
    for (const double rho : {1.0, 10.0, 1e3, 1e5, 1e8}) {
      ASSERT_TRUE(branch.elastic.solve(w.run, rho, Begin::violated, kBudget));
      EXPECT_GE(branch.elastic.objective(), before - 1e-7 * (1.0 + std::abs(before))) << seed;
      before = branch.elastic.objective();
    }
    EXPECT_EQ(branch.point.set.s_fixed, first.s_fixed) << "sides never change by themselves";
    if (!branch.exact.solve(w.run, kBudget)) continue;
    const double exact = branch.point.images.objective;
    EXPECT_NEAR(before, exact, 1e-3 * (1.0 + std::abs(exact))) << seed;
    EXPECT_LE(before, exact + 1e-6 * (1.0 + std::abs(exact))) << seed;
  }
}

TEST(ElasticRelaxation, WhereItIsAnchoredVariablesWithoutCostStay) {
  OwnedProblem p = row_and_pair();
  p.Q = compress(3, 3, {{0, 1}, {0, 1}, {1.0, 1.0}}, "Q").value();
  Workbench w(p);
  BranchEngines branch(w.problem, *w.kkt);
  Vector z = w.zero();
  z[2] = 5.0 / w.problem.variable_scale[2];
  branch.point.start_from_point(z);
  branch.elastic.anchor_here();
  ASSERT_TRUE(branch.elastic.solve(w.run, 1e3, Begin::violated, kBudget));
  EXPECT_NEAR(w.user(branch.point.x.z())[2], 5.0, 1e-6);
  EXPECT_NEAR(branch.elastic.objective(), elastic(w, branch.point.set, 1e3, z, branch.point.x.z()), 1e-9)
      << "and staying costs nothing";
  branch.elastic.anchor_at_zero();
  ASSERT_TRUE(branch.elastic.solve(w.run, 1e3, Begin::violated, kBudget));
  EXPECT_LE(w.user(branch.point.x.z())[2], 1.0 + 1e-6) << "to 0 as far as z ≥ 1 lets it";
}

TEST(ElasticRelaxation, NeverTakesMoreFactorizationsThanItMayAndOneForItsFactor) {
  int short_of = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 16, .equalities = 2, .inequalities = 20, .pairs = 4}, seed);
    for (int budget = 0; budget <= 8; ++budget) {
      Workbench w(p);
      BranchEngines branch(w.problem, *w.kkt);
      branch.point.start_from_point(w.zero());
      short_of += branch.elastic.solve(w.run, 1e4, Begin::violated, budget) ? 0 : 1;
      EXPECT_LE(w.run.factorizations, budget + 1) << "one more where the factor at hand is another's";
    }
  }
  EXPECT_GT(short_of, 20);
}

TEST(ElasticRelaxation, DoesNothingForWhoIsToStop) {
  Rows rows;
  rows.source.request_stop();
  Workbench w(testing::random_problem({}, 1), {}, &rows);
  BranchEngines branch(w.problem, *w.kkt);
  branch.point.start_from_point(w.zero());
  EXPECT_FALSE(branch.elastic.solve(w.run, 1e3, Begin::violated, kBudget));
  EXPECT_EQ(w.run.factorizations, 0);
}

TEST(ElasticRelaxation, LeavesItsOwnFactorBehindWhateverFactorItFound) {
  Workbench w(testing::random_problem({}, 1));
  BranchEngines branch(w.problem, *w.kkt);
  branch.point.start_from_point(w.zero());
  ASSERT_TRUE(branch.elastic.solve(w.run, 1e3, Begin::violated, kBudget));
  ASSERT_TRUE(branch.point.factor(w.run, 1.0, 1.0));
  ASSERT_TRUE(branch.elastic.solve(w.run, 1e3, Begin::violated, kBudget)) << "it is there already";
  EXPECT_EQ(branch.elastic.rho(), 1e3);
}

TEST(ElasticRelaxation, FromTheRowsOfItsSolutionItNeedsNoFactorization) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    BranchEngines branch(w.problem, *w.kkt);
    branch.point.start_from_point(w.zero());
    ASSERT_TRUE(branch.elastic.solve(w.run, 1e3, Begin::violated, kBudget)) << seed;
    const WorkingSet set = branch.point.set;
    const double objective = branch.elastic.objective();
    const int before = w.run.factorizations;
    branch.point.x.z() += Vector::Constant(w.problem.variables(), 0.1);
    ASSERT_TRUE(branch.elastic.solve(w.run, 1e3, Begin::held, kBudget)) << seed;
    EXPECT_EQ(w.run.factorizations, before) << seed << ": the factor at hand is theirs";
    EXPECT_TRUE(branch.point.set == set) << seed;
    EXPECT_NEAR(branch.elastic.objective(), objective, 1e-8 * (1.0 + std::abs(objective))) << seed;
  }
}

// Newton's method brings a row or two to zero a step where rows are neighbours in a chain.
TEST(ElasticRelaxation, ManyRowsThatChangeTakeNoMoreThanItsBudget) {
  for (const double rho : {1e3, 1e6, 1e8}) {
    Workbench w(testing::obstacle_problem(1000));
    BranchEngines branch(w.problem, *w.kkt);
    branch.point.start_from_point(w.zero());
    ASSERT_TRUE(branch.elastic.solve(w.run, rho, Begin::violated, kBudget)) << rho;
    EXPECT_LE(w.run.factorizations, kBudget);
    const double least = elastic(w, branch.point.set, rho, w.zero(), branch.point.x.z());
    EXPECT_NEAR(branch.elastic.objective(), least, 1e-8 * (1.0 + std::abs(least))) << rho;
  }
}

}  // namespace
}  // namespace marble
