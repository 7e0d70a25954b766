// What the end of a solve says of the incumbent: where each word comes from, and that none is said on trust.
#include "solver/optimality.h"

#include <gtest/gtest.h>

#include "branch/branch_engines.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Workbench;

// ½q x² − a x + ½y² + y over 0 ≤ x ⊥ y ≥ 0. On the branch x = 0 the solution is (0, 0); x pulls if a > 0.
OwnedProblem corner(double q, double a) {
  OwnedProblem p;
  p.g = {-a, 1.0};
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {q, 1.0}}, "Q").value();
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

// The solution of the branch x = 0 of all pairs, judged.
struct Judged : Workbench {
  explicit Judged(const OwnedProblem& p, const Options& chosen = {})
      : Workbench(p, chosen),
        branch(problem, *kkt),
        incumbent(problem, options, branch.exact),
        optimality(problem, *kkt, options, branch.point, incumbent) {
    for (Index pair = 0; pair < problem.pairs(); ++pair) branch.point.set.fix(pair, true, false);
    if (problem.inequalities() > 0) branch.point.set.held[0] = 1;
    EXPECT_EQ(incumbent.solve_branch(run, "a branch", 100), Incumbent::Outcome::kept);
    factorizations = run.factorizations;
    verdict = optimality.judge(run);
    factorizations = run.factorizations - factorizations;
  }
  [[nodiscard]] double objective() const { return judged(incumbent.best().x.z()).objective; }

  BranchEngines branch;
  Incumbent incumbent;
  Optimality optimality;
  Optimality::Verdict verdict;
  int factorizations = 0;
};

Options without_search() {
  Options options;
  options.max_local_search_factorizations = 0;
  return options;
}

TEST(Optimality, AStronglyStationaryPointOfAConvexProblemIsAMinimumAtNoCost) {
  const Judged j(corner(1.0, -1.0));
  EXPECT_EQ(j.verdict.b_stationary, true);
  EXPECT_EQ(j.verdict.second_order, SecondOrder::minimum);
  EXPECT_EQ(j.factorizations, 0);
  EXPECT_NEAR(j.objective(), 0.0, 1e-12);
}

TEST(Optimality, APointThatAnotherBranchCanLeaveIsLeft) {
  const Judged j(corner(1.0, 2.0));
  EXPECT_NEAR(j.objective(), -2.0, 1e-9);
  EXPECT_STREQ(j.incumbent.best().origin, "neighbouring branch");
  EXPECT_EQ(j.verdict.b_stationary, true);
  EXPECT_EQ(j.verdict.second_order, SecondOrder::minimum);
}

// ½|z|² + y₁ + y₂ − a₁x₁ − a₂x₂ over 0 ≤ xᵢ ⊥ yᵢ ≥ 0, z = (x₁, y₁, x₂, y₂), all zero on the branch x = 0.
OwnedProblem two_corners(double a1, double a2) {
  OwnedProblem p;
  p.g = {-a1, 1.0, -a2, 1.0};
  p.Q = compress(4, 4, {{0, 1, 2, 3}, {0, 1, 2, 3}, {1.0, 1.0, 1.0, 1.0}}, "Q").value();
  p.L = compress(2, 4, {{0, 1}, {0, 2}, {1.0, 1.0}}, "L").value();
  p.R = compress(2, 4, {{0, 1}, {1, 3}, {1.0, 1.0}}, "R").value();
  p.l = p.r = {0.0, 0.0};
  return p;
}

TEST(Optimality, ABranchIsLeftWhicheverOfItsPairsHaveToChange) {
  EXPECT_NEAR(Judged(two_corners(2.0, -1.0)).objective(), -2.0, 1e-9);
  EXPECT_NEAR(Judged(two_corners(-1.0, 2.0)).objective(), -2.0, 1e-9);
  OwnedProblem both = two_corners(2.0, 2.0);  // x₁ = x₂: neither can do without the other
  both.A = compress(1, 4, {{0, 0}, {0, 2}, {1.0, -1.0}}, "A").value();
  both.b = {0.0};
  EXPECT_NEAR(Judged(both).objective(), -4.0, 1e-9);
}

TEST(Optimality, ABranchBesideTheWayThatFallsForEverMakesTheProblemUnbounded) {
  // And ½(y₂ − x₁)² instead of ½y₂² + y₂, and x₂ falls for ever where y₂ = 0. From 0 to x₁ = y₂ = 2, where x₂
  // = 0 alone, and past that branch.
  OwnedProblem p = two_corners(2.0, 1.0);
  p.g[3] = 0.0;
  p.Q = compress(4, 4, {{0, 0, 1, 3, 3}, {0, 3, 1, 0, 3}, {2.0, -1.0, 1.0, -1.0, 1.0}}, "Q").value();
  const Judged j(p);
  ASSERT_TRUE(j.verdict.unbounded.has_value());
  EXPECT_NEAR(j.verdict.unbounded->direction[2], 1.0, 1e-9) << "x₂";
  EXPECT_FALSE(j.verdict.b_stationary.has_value());
}

TEST(Optimality, WithoutABudgetNothingIsSaidOfOtherBranches) {
  const Judged convex(corner(1.0, 2.0), without_search());
  EXPECT_FALSE(convex.verdict.b_stationary.has_value());
  EXPECT_EQ(convex.verdict.second_order, SecondOrder::minimum) << "on its own branch";
  EXPECT_NEAR(convex.objective(), 0.0, 1e-12);
}

TEST(Optimality, WhereAMultiplierPullsTheCurvatureOfOneBranchIsNotThatOfAll) {
  const Judged nonconvex(corner(-1.0, 2.0), without_search());
  EXPECT_FALSE(nonconvex.verdict.b_stationary.has_value());
  EXPECT_EQ(nonconvex.verdict.second_order, SecondOrder::necessary);
}

TEST(Optimality, ASaddlePointIsLeftAndWhatComesOfItIsJudgedAnew) {
  // And −½w² over 0 ≤ w ≤ 1: w = 0 is stationary, with a multiplier of 0.
  OwnedProblem p = corner(1.0, -1.0);
  p.g.push_back(0.0);
  p.Q = compress(3, 3, {{0, 1, 2}, {0, 1, 2}, {1.0, 1.0, -1.0}}, "Q").value();
  p.C = compress(2, 3, {{0, 1}, {2, 2}, {1.0, -1.0}}, "C").value();
  p.d = {0.0, 1.0};
  p.L = compress(1, 3, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 3, {{0}, {1}, {1.0}}, "R").value();
  const Judged j(p);
  EXPECT_NEAR(j.user(j.incumbent.best().x.z())[2], 1.0, 1e-9);
  EXPECT_STREQ(j.incumbent.best().origin, "descent along negative curvature");
  EXPECT_EQ(j.verdict.second_order, SecondOrder::minimum);
  EXPECT_EQ(j.verdict.b_stationary, true);
  const Judged stays(p, without_search());
  EXPECT_NEAR(stays.user(stays.incumbent.best().x.z())[2], 0.0, 1e-9);
  EXPECT_EQ(stays.verdict.second_order, SecondOrder::saddle);
}

TEST(Optimality, WhereAnotherBranchFallsForEverThatIsTheVerdict) {
  const Judged j(corner(0.0, 2.0));
  EXPECT_FALSE(j.verdict.b_stationary.has_value());
  ASSERT_TRUE(j.verdict.unbounded.has_value());
  EXPECT_NEAR(j.verdict.unbounded->direction[0], 1.0, 1e-9);
  EXPECT_NEAR(j.objective(), 0.0, 1e-12) << "what could not be solved is no answer";
}

}  // namespace
}  // namespace marble
