// What the ways to solve a branch rely on of the point they share: the rows read off, and what a factor does.
#include "branch/branch_point.h"

#include <gtest/gtest.h>

#include "branch/branch_engines.h"
#include "model/tuning.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::row_and_pair;
using testing::Workbench;

constexpr int kBudget = 100;

Options unscaled() {
  Options options;
  options.scaling_passes = 0;
  return options;
}

TEST(BranchPoint, ReadsABranchOffAPathPoint) {
  Workbench w(row_and_pair(), unscaled());
  BranchEngines branch(w.problem, *w.kkt);
  Iterate x(w.problem);
  x.z() << 0.1, 2.0, 1.5;
  x.v()[0] = 0.5;
  x.lambda_w()[0] = -0.3;
  x.lambda_L()[0] = 0.7;
  x.lambda_R()[0] = -0.2;
  branch.point.start_from_path(x);
  EXPECT_EQ(branch.point.set.s_fixed[0], 1) << "x < y";
  EXPECT_EQ(branch.point.set.held[0], 0) << "v > 0";
  EXPECT_EQ(branch.point.set.held[branch.point.set.free_row(0)], 0) << "y is larger than its multiplier";
  EXPECT_EQ(branch.point.x.lambda_w()[0], 0.0) << "what is not active has no multiplier";
  EXPECT_EQ(branch.point.x.lambda_R()[0], 0.0);
  EXPECT_EQ(branch.point.x.lambda_L()[0], 0.7) << "that of a fixed side stays";
  EXPECT_EQ(branch.point.x.z(), x.z());
  x.z() << 2.0, 0.1, 1.5;
  x.v()[0] = -0.5;
  x.lambda_L()[0] = -3.0;
  branch.point.start_from_path(x);
  EXPECT_EQ(branch.point.set.s_fixed[0], 0);
  EXPECT_EQ(branch.point.set.held[0], 1);
  EXPECT_EQ(branch.point.set.held[branch.point.set.free_row(0)], 1) << "x = 2 against its multiplier 3";
}

TEST(BranchPoint, ReadsABranchOffASolutionOfAnotherProblem) {
  Workbench w(row_and_pair(), unscaled());
  BranchEngines branch(w.problem, *w.kkt);
  Iterate x(w.problem);
  x.z() << 0.4, 0.5, 1.01;  // sides that are both off zero: the multipliers decide
  x.lambda_w()[0] = -0.5;
  x.lambda_L()[0] = 0.1;
  x.lambda_R()[0] = -2.0;
  branch.point.start_from_solution(x);
  EXPECT_EQ(branch.point.set.s_fixed[0], 0) << "y − |η| < x − |ξ|";
  EXPECT_EQ(branch.point.set.held[0], 1) << "slack 0.01 against multiplier 0.5";
  EXPECT_EQ(branch.point.set.held[branch.point.set.free_row(0)], 0);
  x.lambda_L()[0] = -0.45;
  x.lambda_R()[0] = 0.1;
  x.z()[2] = 2.0;
  branch.point.start_from_solution(x);
  EXPECT_EQ(branch.point.set.s_fixed[0], 1);
  EXPECT_EQ(branch.point.set.held[0], 0);
}

TEST(BranchPoint, ReadsABranchOffAPoint) {
  Workbench w(row_and_pair(), unscaled());
  BranchEngines branch(w.problem, *w.kkt);
  const Eigen::Vector3d s_smaller(0.1, 0.2, 0.0), t_smaller(0.3, 0.2, 0.0);
  branch.point.start_from_point(s_smaller);
  EXPECT_EQ(branch.point.set.s_fixed[0], 1);
  branch.point.start_from_point(t_smaller);
  EXPECT_EQ(branch.point.set.s_fixed[0], 0);
  EXPECT_EQ(branch.point.x.z(), t_smaller);
}

TEST(BranchPoint, AFactorReportsNegativeCurvatureThatNoRowHolds) {
  OwnedProblem p = row_and_pair();
  p.Q = compress(3, 3, {{0, 1, 2}, {0, 1, 2}, {1.0, 1.0, -1.0}}, "Q").value();
  Workbench w(p);
  BranchEngines branch(w.problem, *w.kkt);
  EXPECT_FALSE(branch.point.factor(w.run, tuning::exact_rho, tuning::exact_delta));
  WorkingSet set = branch.point.set;
  set.held[0] = 1;
  branch.point.set = set;
  EXPECT_TRUE(branch.point.factor(w.run, tuning::exact_rho, tuning::exact_delta));
  EXPECT_EQ(w.run.factorizations, 2);
  branch.point.set = WorkingSet(w.problem);
  EXPECT_FALSE(branch.exact.solve(w.run, kBudget)) << "without a minimum there is no solution";
}

TEST(BranchPoint, WithAFactorItProjectsAndSharpens) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    BranchEngines branch(w.problem, *w.kkt);
    branch.point.start_from_point(w.zero());
    if (!branch.exact.solve(w.run, kBudget)) continue;
    const Vector solution = branch.point.x.z();
    ASSERT_TRUE(branch.point.factor(w.run, tuning::exact_rho, tuning::exact_delta));
    Vector direction = Vector::LinSpaced(w.problem.variables(), -1.0, 2.0);
    ASSERT_TRUE(branch.point.project(direction));
    Images along(w.problem);
    along.evaluate_rows(w.problem, direction);
    EXPECT_LE(max_abs(along.equality), 1e-6) << seed;
    for (std::size_t k = 0; k < branch.point.set.s_fixed.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      EXPECT_NEAR(branch.point.set.s_fixed[k] ? along.rows.s()[i] : along.rows.t()[i], 0.0, 1e-6) << seed;
    }
    Iterate x = branch.point.x;
    x.z() += 1e-3 * Vector::Ones(x.z().size());
    branch.point.restore(x, branch.point.set);
    ASSERT_TRUE(branch.point.sharpen());
    EXPECT_LE(max_abs(branch.point.x.z() - solution), 1e-9) << seed;
  }
}

// z₁ = 0 and z₁ + εz₂ = ε: a sweep leaves 1/(1 + ρε²/2) of the error in their difference.
TEST(BranchPoint, SharpensWhereRowsNearlyDependOnEachOther) {
  for (const double epsilon : {1e-4, 5e-5}) {
    OwnedProblem p;
    p.g = {0.0, 0.0};
    p.Q = compress(2, 2, {{0, 1}, {0, 1}, {1.0, 1.0}}, "Q").value();
    p.C = compress(2, 2, {{0, 1, 1}, {0, 0, 1}, {1.0, 1.0, epsilon}}, "C").value();
    p.d = {0.0, -epsilon};
    Workbench w(p, unscaled());
    BranchEngines branch(w.problem, *w.kkt);
    branch.point.set.held = {1, 1};
    ASSERT_TRUE(branch.point.factor(w.run, tuning::exact_rho, tuning::exact_delta));
    branch.point.x.z()[1] = 1.0 + 5.0 * tuning::exactness / epsilon;
    branch.point.x.lambda() << 1.0 / epsilon, -1.0 / epsilon;
    EXPECT_TRUE(branch.point.sharpen()) << epsilon;
    EXPECT_LE(branch.point.error(), tuning::exactness) << epsilon;
    EXPECT_NEAR(branch.point.x.z()[1], 1.0, 2.0 * tuning::exactness / epsilon);
  }
}

// z₁ = 0 and z₁ = 1: the multipliers only grow.
TEST(BranchPoint, SharpensNothingWhereRowsContradictEachOther) {
  OwnedProblem p;
  p.g = {0.0};
  p.Q = compress(1, 1, {{0}, {0}, {1.0}}, "Q").value();
  p.C = compress(2, 1, {{0, 1}, {0, 0}, {1.0, 1.0}}, "C").value();
  p.d = {0.0, -1.0};
  Workbench w(p, unscaled());
  BranchEngines branch(w.problem, *w.kkt);
  branch.point.set.held = {1, 1};
  ASSERT_TRUE(branch.point.factor(w.run, tuning::exact_rho, tuning::exact_delta));
  EXPECT_FALSE(branch.point.sharpen());
}

TEST(BranchPoint, AFactorMadeAheadIsTakenOverOnceAndByTheSameRowsAlone) {
  Workbench w(row_and_pair(), unscaled());
  BranchEngines branch(w.problem, *w.kkt);
  const auto factor = [&] { return branch.point.factor(w.run, tuning::exact_rho, tuning::exact_delta); };
  const auto made_by = [&](auto&& work) {
    const std::int64_t before = w.kkt->factors();
    work();
    return w.kkt->factors() - before;
  };
  const auto ahead = [&] { branch.point.factor_ahead(w.run, tuning::exact_rho, tuning::exact_delta); };
  EXPECT_EQ(made_by(ahead), 1);
  const int counted = w.run.factorizations;
  EXPECT_EQ(made_by([&] { EXPECT_TRUE(factor()); }), 0);
  EXPECT_EQ(w.run.factorizations, counted + 1) << "it counts as the solve's own";
  EXPECT_EQ(made_by([&] { EXPECT_TRUE(factor()); }), 1) << "only once";
  ahead();
  branch.point.set.held[0] ^= 1U;
  EXPECT_EQ(made_by([&] { EXPECT_TRUE(factor()); }), 1) << "of other rows";
  ahead();
  branch.point.forget_ahead();
  EXPECT_EQ(made_by([&] { EXPECT_TRUE(factor()); }), 1) << "of other matrices";
}

}  // namespace
}  // namespace marble
