// What the stages of a solve rely on of the incumbent: it only gets better, and says where it is from.
#include "search/incumbent.h"

#include <gtest/gtest.h>

#include <cmath>

#include "branch/branch_engines.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using Outcome = Incumbent::Outcome;
using testing::Workbench;

constexpr int kBudget = 100;

// min (x − 1)² + (y − 2)² over 0 ≤ x ⊥ y ≥ 0: 1 on the branch x = 0, 4 on the branch y = 0.
OwnedProblem corner() {
  OwnedProblem p;
  p.g = {-2.0, -4.0};
  p.c0 = 5.0;
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {2.0, 2.0}}, "Q").value();
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

struct Kept : Workbench {
  explicit Kept(const OwnedProblem& p)
      : Workbench(p), branch(problem, *kkt), incumbent(problem, options, branch.exact) {}

  [[nodiscard]] Outcome solve(bool s, const char* origin) {
    WorkingSet set(problem);
    set.fix(0, s, false);
    branch.point.set = set;
    return incumbent.solve_branch(run, origin, kBudget);
  }
  [[nodiscard]] double objective() const { return judged(incumbent.best().x.z()).objective; }

  BranchEngines branch;
  Incumbent incumbent;
};

TEST(Incumbent, KeepsTheBetterOfTwoBranchesWhicheverComesFirst) {
  for (const bool better_first : {false, true}) {
    Kept k(corner());
    EXPECT_FALSE(k.incumbent.exists());
    EXPECT_EQ(k.solve(better_first, "first"), Outcome::kept);
    EXPECT_EQ(k.solve(!better_first, "second"), better_first ? Outcome::no_better : Outcome::kept);
    EXPECT_TRUE(k.incumbent.exists());
    EXPECT_NEAR(k.objective(), 1.0, 1e-9);
    EXPECT_STREQ(k.incumbent.best().origin, better_first ? "first" : "second");
    EXPECT_NEAR(k.judged(k.incumbent.other().x.z()).objective, 4.0, 1e-9) << "the other one is still at hand";
  }
}

// From 0, which most branches do not contain.
TEST(Incumbent, TheInteriorPointMethodSolvesABranchAsExchangesOfRowsDo) {
  int solved = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 30, .equalities = 5, .inequalities = 12, .pairs = 9}, seed);
    Kept by_rows(p);
    Kept by_interior(p);
    WorkingSet set(by_rows.problem);
    for (Index pair = 0; pair < by_rows.problem.pairs(); ++pair)
      set.fix(pair, (seed >> pair % 5 & 1U) != 0, false);
    by_rows.branch.point.set = set;
    if (by_rows.incumbent.solve_branch(by_rows.run, "rows", kBudget) != Outcome::kept) continue;
    QuadraticEngine engine(by_interior.problem, *by_interior.kkt);
    const Vector zero = Vector::Zero(by_interior.problem.variables());
    engine.start(zero, set);
    ASSERT_TRUE(by_interior.incumbent.solve_branch(by_interior.run, engine)) << "seed " << seed;
    EXPECT_NEAR(by_interior.objective(), by_rows.objective(), 1e-9 * (1.0 + std::abs(by_rows.objective())));
    for (Index pair = 0; pair < set.layout.pairs; ++pair)
      EXPECT_EQ(by_interior.incumbent.best().set.s_fixed[pair], set.s_fixed[pair]);
    ++solved;
  }
  EXPECT_GE(solved, 20);
}

TEST(Incumbent, TheSameSolutionAgainIsNoBetter) {
  Kept k(corner());
  EXPECT_EQ(k.solve(true, "first"), Outcome::kept);
  EXPECT_EQ(k.solve(true, "again"), Outcome::no_better);
  EXPECT_STREQ(k.incumbent.best().origin, "first");
  k.incumbent.clear();
  EXPECT_EQ(k.solve(false, "of another solve"), Outcome::kept) << "what was cleared is no bar";
}

TEST(Incumbent, TakesOnlyOffersThatAreFeasibleAndLower) {
  Kept k(corner());
  EXPECT_EQ(k.solve(false, "a branch"), Outcome::kept);
  const WorkingSet set = k.incumbent.best().set;
  const auto offer = [&](double x, double y) {
    Iterate point(k.problem);
    point.z() << x / k.problem.variable_scale[0], y / k.problem.variable_scale[1];
    k.incumbent.offer(point, k.images(point), set, "an offer");
  };
  offer(1.0, 2.0);
  EXPECT_STREQ(k.incumbent.best().origin, "a branch") << "0, but not feasible";
  offer(1.5, 0.0);
  EXPECT_STREQ(k.incumbent.best().origin, "a branch") << "feasible, but 4.25";
  offer(0.0, 2.5);
  EXPECT_STREQ(k.incumbent.best().origin, "an offer");
  EXPECT_NEAR(k.objective(), 1.25, 1e-12);
}

TEST(SolveExactly, RefusesBranchesThatAreNotFeasibleAndKeepsThePointItWasGiven) {
  testing::Workbench w(testing::without_feasible_branch());
  BranchEngines branch(w.problem, *w.kkt);
  ExactSolution solution(w.problem);
  solution.x.all.setConstant(7.0);
  solution.objective = -3.0;
  branch.point.start_from_point(w.zero());
  EXPECT_FALSE(solve_exactly(w.problem, w.options, branch.exact, w.run, 100, solution));
  EXPECT_EQ(solution.objective, -3.0);
  EXPECT_EQ(solution.x.all.minCoeff(), 7.0);
}

}  // namespace
}  // namespace marble
