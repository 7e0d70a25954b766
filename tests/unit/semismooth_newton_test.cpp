// What the exact and the elastic solution of a branch rely on: a minimum, whatever the start, or a no.
#include "branch/semismooth_newton.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/branch.h"
#include "support/brute_force.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Workbench;

constexpr SemismoothNewton::Penalty kPenalty{1e7, 1e-7};
constexpr int kNoLimit = 1'000;

TEST(SemismoothNewton, ConvergesToTheExactSolutionOfABranchOrSaysThatItIsEmpty) {
  int solved = 0;
  int empty = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 8, .equalities = 2, .inequalities = 5, .pairs = 3}, seed);
    const auto side = static_cast<unsigned>(seed % 8);
    const auto best = testing::brute_force(testing::branch(p, side).view());
    Workbench w(p);
    BranchPoint point(w.problem, *w.kkt);
    SemismoothNewton newton(w.problem, *w.kkt, point);
    for (Index pair = 0; pair < 3; ++pair) point.set.fix(pair, (side >> pair & 1U) != 0, false);
    ASSERT_EQ(newton.converge(w.run, kPenalty, kNoLimit), best.has_value()) << seed;
    ++(best ? solved : empty);
    if (!best) continue;
    EXPECT_LE(w.judged(point.x.z()).infeasibility(), 1e-6) << seed;
    EXPECT_NEAR(w.judged(point.x.z()).objective, best->objective, 1e-6 * (1.0 + std::abs(best->objective)))
        << seed;
  }
  EXPECT_GT(solved, 15);
  EXPECT_GT(empty, 5);
}

TEST(SemismoothNewton, WhereItsMinimumIsDoesNotDependOnWhereItBegins) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Workbench w(testing::random_problem({.inequalities = 12}, seed));
    std::vector<Vector> found;
    for (const double from : {0.0, -3.0, 5.0}) {
      BranchPoint point(w.problem, *w.kkt);
      SemismoothNewton newton(w.problem, *w.kkt, point);
      point.x.z().setConstant(from);
      ASSERT_TRUE(newton.minimize(w.run, {1e4, 1e-6}, kNoLimit)) << seed;
      found.push_back(point.x.z());
    }
    EXPECT_LE(max_abs(found[1] - found[0]), 1e-6 * (1.0 + max_abs(found[0]))) << seed;
    EXPECT_LE(max_abs(found[2] - found[0]), 1e-6 * (1.0 + max_abs(found[0]))) << seed;
  }
}

TEST(SemismoothNewton, StopsAtItsLastFactorizationAndWhereTheObjectiveHasNoBound) {
  Workbench w(testing::random_problem({.inequalities = 12}, 1));
  BranchPoint point(w.problem, *w.kkt);
  SemismoothNewton newton(w.problem, *w.kkt, point);
  EXPECT_FALSE(newton.minimize(w.run, kPenalty, 0));
  EXPECT_EQ(w.run.factorizations, 0);
  OwnedProblem p = testing::row_and_pair();
  p.Q = compress(3, 3, {{0, 1, 2}, {0, 1, 2}, {1.0, 1.0, -1.0}}, "Q").value();
  Workbench downhill(p);
  BranchPoint there(downhill.problem, *downhill.kkt);
  there.x.z().setConstant(2.0);
  SemismoothNewton lost(downhill.problem, *downhill.kkt, there);
  EXPECT_FALSE(lost.minimize(downhill.run, kPenalty, kNoLimit));
}

}  // namespace
}  // namespace marble
