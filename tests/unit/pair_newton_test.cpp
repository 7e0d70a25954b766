// Mixed complementarity problems whose branches are linear systems: obstacles under membranes.
#include "global/pair_newton.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "branch/branch_engines.h"
#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Workbench;

// 0 ≤ u − ψ ⊥ −Δu ≥ 0 on n × n points of the unit square, u = 0 around it, ψ = sin(3.2 x) sin(3.2 y): no
// cost.
OwnedProblem membrane(Index n) {
  const double h = 1.0 / (n + 1);
  OwnedProblem p;
  p.name = "membrane";
  const Index size = n * n;
  p.g.assign(static_cast<std::size_t>(size), 0.0);
  p.r.assign(static_cast<std::size_t>(size), 0.0);
  Triplets laplacian, identity;
  for (Index row = 0; row < n; ++row) {
    for (Index column = 0; column < n; ++column) {
      const Index k = row * n + column;
      identity.add(k, k, 1.0);
      laplacian.add(k, k, 4.0 / (h * h));
      if (row > 0) laplacian.add(k, k - n, -1.0 / (h * h));
      if (row + 1 < n) laplacian.add(k, k + n, -1.0 / (h * h));
      if (column > 0) laplacian.add(k, k - 1, -1.0 / (h * h));
      if (column + 1 < n) laplacian.add(k, k + 1, -1.0 / (h * h));
      p.l.push_back(-std::sin(3.2 * h * (row + 1)) * std::sin(3.2 * h * (column + 1)));
    }
  }
  p.L = compress(size, size, identity, "L").value();
  p.R = compress(size, size, laplacian, "R").value();
  return p;
}

TEST(PairNewton, IsForProblemsWhoseBranchesDetermineAPoint) {
  const Workbench square(membrane(4));
  EXPECT_TRUE(pair_newton_applies(square.problem));
  const Workbench wide(
      testing::random_problem({.variables = 9, .equalities = 2, .inequalities = 0, .pairs = 4}, 1));
  EXPECT_FALSE(pair_newton_applies(wide.problem)) << "more unknowns than rows";
  const Workbench bounded(
      testing::random_problem({.variables = 6, .equalities = 2, .inequalities = 1, .pairs = 4}, 1));
  EXPECT_FALSE(pair_newton_applies(bounded.problem)) << "an inequality that it would not see";
}

TEST(PairNewton, EndsAtTheSolutionFromAnyBranch) {
  Workbench bench(membrane(12));
  const OwnedProblem p = membrane(12);
  BranchEngines engines(bench.problem, *bench.kkt);
  for (const bool lies : {false, true}) {
    WorkingSet set(bench.problem);
    for (Index pair = 0; pair < bench.problem.pairs(); ++pair) set.fix(pair, lies, false);
    engines.point.restore(Iterate(bench.problem), set);
    ASSERT_TRUE(pair_newton(bench.run, bench.problem, engines.point)) << lies;
    EXPECT_LE(engines.point.violation(), 1e-9);
    const auto& rows = engines.point.images.rows;
    EXPECT_GE(rows.s().minCoeff(), -1e-9);
    EXPECT_GE(rows.t().minCoeff(), -1e-9);
  }
}

TEST(PairNewton, GivesUpWhereTheSumOfNegativeSidesDoesNotFall) {
  // w = −z + 1 against −z − 1: no solution, whatever the branch.
  OwnedProblem p;
  p.g = {0.0};
  p.L = compress(1, 1, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 1, {{0}, {0}, {-1.0}}, "R").value();
  p.l = {0.0};
  p.r = {-1.0};
  Workbench bench(p);
  BranchEngines engines(bench.problem, *bench.kkt);
  EXPECT_FALSE(pair_newton(bench.run, bench.problem, engines.point));
  EXPECT_LE(bench.run.factorizations, 4);
}

// Beyond 62 × 62 points they had taken a search of thousands of factorizations.
TEST(PairNewton, KeepsLargeMembranesAsCheapAsSmallOnes) {
  for (const Index n : {40, 70}) {
    const OwnedProblem p = membrane(n);
    const Solution s = solve_in_process(p.view(), {}).value();
    EXPECT_EQ(s.status, Status::solved) << n << ": " << s.detail;
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << n;
    EXPECT_LE(s.factorizations, 100) << n << ": " << s.detail;
  }
}

}  // namespace
}  // namespace marble
