// Small problems get the global answer within max_small_problem_nodes, and larger ones do not pay for it.
#include <gtest/gtest.h>

#include <cmath>

#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
#include "support/small_problems.h"

namespace marble {
namespace {

Solution solved(const OwnedProblem& p, const Options& options) {
  return solve_in_process(p.view(), options).value();
}

OwnedProblem small(std::uint64_t seed) {
  return testing::random_problem({.variables = 10, .equalities = 1, .inequalities = 4, .pairs = 8}, seed);
}

TEST(SmallProblem, EndsAtTheGlobalOptimumWithItsProof) {
  Options local, global;
  local.max_small_problem_nodes = 0;
  global.global_search = true;
  int convex = 0;
  int lower = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const OwnedProblem p = small(seed);
    const Solution s = solved(p, {});
    const Solution by_local = solved(p, local);
    if (s.status != Status::solved) continue;
    const Solution by_tree = solved(p, global);
    if (by_tree.nodes == 0) continue;  // Q is not convex
    ++convex;
    const double tolerance = 2e-6 * (1.0 + std::abs(by_tree.objective));
    EXPECT_TRUE(s.proved) << seed << ": " << s.detail;
    EXPECT_LE(s.gap, 1e-6) << seed;
    EXPECT_NEAR(s.objective, by_tree.objective, tolerance) << seed;
    EXPECT_LE(s.bound, by_tree.objective + 1e-9 * (1.0 + std::abs(by_tree.objective))) << seed;
    EXPECT_NE(s.detail.find("; max_small_problem_nodes: proved by "), std::string::npos) << s.detail;
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-8) << seed;
    EXPECT_GE(s.nodes, 1) << "counted, as detail says: " << s.detail;
    EXPECT_EQ(s.open_nodes, 0) << seed;
    EXPECT_EQ(by_local.nodes, 0) << seed;
    EXPECT_FALSE(by_local.proved) << seed;
    EXPECT_EQ(by_local.bound, -std::numeric_limits<double>::infinity()) << seed;
    lower += s.objective < by_local.objective - tolerance ? 1 : 0;
  }
  EXPECT_GT(convex, 50);
  EXPECT_GT(lower, 0) << "or there is nothing to look for";
}

// bard1 of MacMPEC: relaxations flat along three variables, and steps onto a side from outside it. One that
// went on along such a step ended at 10^15 and left nodes undecided.
TEST(SmallProblem, IsProvedWhereRelaxationsAreFlat) {
  const Solution s = solved(testing::of_macmpec("bard1").problem, {});
  EXPECT_NEAR(s.objective, 17.0, 1e-8);
  EXPECT_TRUE(s.proved) << s.detail;
  EXPECT_LE(s.factorizations, 10);
}

TEST(SmallProblem, ATreeCutShortLosesNothingAndLeavesItsBound) {
  Options local, few;
  local.max_small_problem_nodes = 0;
  few.max_small_problem_nodes = 1;
  int unproved = 0;
  int counted = 0, bounded = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const OwnedProblem p = small(seed);
    const Solution s = solved(p, few);
    const Solution by_local = solved(p, local);
    if (s.status != Status::solved) continue;
    EXPECT_LE(s.objective, by_local.objective + 1e-9 * (1.0 + std::abs(s.objective))) << seed;
    if (s.proved) continue;
    ++unproved;
    if (s.detail.find("max_small_problem_nodes: not proved by 1 nodes") != std::string::npos) ++counted;
    EXPECT_LE(s.nodes, 1) << s.detail;
    EXPECT_EQ(s.nodes > 0, s.detail.find("max_small_problem_nodes: not proved by") != std::string::npos)
        << s.detail;
    const double optimum =
        std::isfinite(s.bound) ? solved(p, {.global_search = true}).objective : s.objective;
    EXPECT_LE(s.bound, optimum + 1e-9 * (1.0 + std::abs(optimum))) << seed;
    bounded += std::isfinite(s.bound) && std::isfinite(s.gap);
  }
  EXPECT_GT(unproved, 0);
  EXPECT_GT(bounded, 0) << "a tree cut short leaves its bound";
  EXPECT_GT(counted, 0) << "nodes says what detail says";
}

// A branch at which pairs pull may not be the best: the tree compares it with the others, for less than a
// cold solve.
TEST(SmallProblem, AWarmSolveIsTheBestBranchForLessThanAColdSolve) {
  Options local;
  local.max_small_problem_nodes = 0;
  int proved = 0, warm_work = 0, cold_work = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p = small(seed);
    const Problem problem = Problem::create(p.view()).value();
    const Solution start = solved(p, local), cold = solved(p, {});
    if (start.status != Status::solved || !cold.proved) continue;
    const Solution warm = Solver::create(problem).value().solve({.warm_start = &start}).value();
    EXPECT_NEAR(warm.objective, cold.objective, 1e-6 * (1.0 + std::abs(cold.objective))) << seed;
    proved += warm.proved ? 1 : 0;
    warm_work += warm.factorizations;
    cold_work += cold.factorizations;
  }
  EXPECT_GT(proved, 10);
  EXPECT_LT(warm_work, cold_work);
}

// polish=false is about how a path ends, not about where a solve begins.
TEST(SmallProblem, AWarmStartIsTakenWithoutPolishToo) {
  Options rough;
  rough.polish = false;
  int taken = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p = small(seed);
    const Solution cold = solved(p, {});
    if (cold.status != Status::solved) continue;
    const Problem problem = Problem::create(p.view()).value();
    const Solution polished = Solver::create(problem).value().solve({.warm_start = &cold}).value();
    const Solution warm = Solver::create(problem, rough).value().solve({.warm_start = &cold}).value();
    EXPECT_EQ(warm.status, Status::solved) << seed;
    EXPECT_NEAR(warm.objective, cold.objective, 1e-9 * (1.0 + std::abs(cold.objective))) << seed;
    EXPECT_LE(warm.factorizations, polished.factorizations) << seed << ": " << warm.detail;
    ++taken;
  }
  EXPECT_GT(taken, 10);
}

// Softening an answer never leaves its basin there; each start is elsewhere.
TEST(SmallProblem, IndefiniteOnesGetStartsElsewhere) {
  Options one, many;
  one.max_small_problem_nodes = many.max_small_problem_nodes = 0;
  many.num_starts = 16;
  int lower = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p = testing::random_problem(
        {.variables = 12, .equalities = 0, .inequalities = 24, .pairs = 4, .indefinite = true}, seed);
    const Solution first = solved(p, one);
    const Solution best = solved(p, many);
    if (first.status != Status::solved || best.status != Status::solved) continue;
    EXPECT_LE(testing::judge(p.view(), best).infeasibility(), 1e-6) << seed;
    EXPECT_NE(best.second_order, SecondOrder::saddle) << seed << ": " << best.detail;
    lower += best.objective < first.objective - 1e-6 ? 1 : 0;
  }
  EXPECT_GT(lower, 0);
}

// Each start of a small one has max_small_problem_nodes of its own.
TEST(SmallProblem, StartsOfIndefiniteOnesLookInAsManyPlaces) {
  Options one, many;
  many.num_starts = 8;
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const OwnedProblem p = testing::random_problem(
        {.variables = 20, .equalities = 0, .inequalities = 40, .pairs = 7, .indefinite = true}, seed);
    const Solution first = solved(p, one);
    const Solution best = solved(p, many);
    if (first.status != Status::solved || best.status != Status::solved) continue;
    EXPECT_GT(best.factorizations, first.factorizations + 7 * one.max_small_problem_nodes - 1) << seed;
    EXPECT_LE(best.objective, first.objective + 1e-9 * (1.0 + std::abs(first.objective))) << seed;
    ++compared;
  }
  EXPECT_GT(compared, 0);
}

}  // namespace
}  // namespace marble
