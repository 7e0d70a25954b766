// What others rely on: the exact solution of a branch or a no, at no more factorizations than allowed.
#include "branch/exact_branch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "branch/branch_engines.h"
#include "support/branch.h"
#include "support/brute_force.h"
#include "support/random_problem.h"
#include "support/small_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Rows;
using testing::Workbench;

constexpr int kBudget = 100;

void choose(BranchEngines& branch, unsigned s_fixed) {
  WorkingSet set = branch.point.set;
  for (Index pair = 0; pair < set.layout.pairs; ++pair)
    set.fix(pair, (s_fixed >> pair & 1U) != 0, set.held[set.free_row(pair)] != 0);
  branch.point.set = set;
}

void expect_optimal(const Workbench& w, const BranchEngines& branch, const std::string& what) {
  constexpr double kSign = 1e-7;
  const Images images = w.images(branch.point.x);
  const WorkingSet& set = branch.point.set;
  EXPECT_LE(branch.point.error(), 1e-9) << what;
  EXPECT_LE(max_abs(images.stationarity), 1e-9) << what;
  EXPECT_LE(max_abs(images.equality), 1e-9) << what;
  for (Index i = 0; i < set.layout.inequalities; ++i) {
    EXPECT_GE(images.rows.inequality()[i], -1e-9) << what;
    EXPECT_LE(branch.point.x.lambda_w()[i], kSign) << what;
    EXPECT_NEAR(set.held[i] ? images.rows.inequality()[i] : branch.point.x.lambda_w()[i], 0.0, 1e-9);
  }
  for (Index i = 0; i < set.layout.pairs; ++i) {
    const bool s_side = set.s_fixed[i] != 0;
    EXPECT_NEAR(s_side ? images.rows.s()[i] : images.rows.t()[i], 0.0, 1e-9) << what << ": the fixed side";
    const double free = s_side ? images.rows.t()[i] : images.rows.s()[i];
    const double multiplier = s_side ? branch.point.x.lambda_R()[i] : branch.point.x.lambda_L()[i];
    EXPECT_GE(free, -1e-9) << what;
    EXPECT_LE(multiplier, kSign) << what << ": only a fixed side may pull";
    EXPECT_NEAR(set.held[set.free_row(i)] ? free : multiplier, 0.0, 1e-9) << what;
  }
}

TEST(ExactBranch, SolvesEveryBranchExactlyOrSaysThatItIsEmpty) {
  int solved = 0;
  int empty = 0;
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 8, .equalities = 2, .inequalities = 5, .pairs = 3}, seed);
    for (unsigned s_fixed = 0; s_fixed < 8; ++s_fixed) {
      const std::string what = p.name + " branch " + std::to_string(s_fixed);
      const auto best = testing::brute_force(testing::branch(p, s_fixed).view());
      Workbench w(p);
      BranchEngines branch(w.problem, *w.kkt);
      choose(branch, s_fixed);
      ASSERT_EQ(branch.exact.solve(w.run, kBudget), best.has_value()) << what;
      EXPECT_LE(w.run.factorizations, kBudget) << what;
      if (!best) {
        ++empty;
        continue;
      }
      ++solved;
      expect_optimal(w, branch, what);
      EXPECT_NEAR(w.judged(branch.point.x.z()).objective, best->objective,
                  1e-6 * (1.0 + std::abs(best->objective)))
          << what;
    }
  }
  EXPECT_GT(solved, 50);
  EXPECT_GT(empty, 10);
}

TEST(ExactBranch, SolvesDegenerateBranchesAsWell) {
  for (const auto& problems : {testing::small_problems(), testing::known_problems()}) {
    for (const auto& [problem, optimum] : problems) {
      if (problem.l.size() > 5) continue;
      double lowest = std::numeric_limits<double>::infinity();
      for (unsigned s_fixed = 0; s_fixed < 1U << problem.l.size(); ++s_fixed) {
        Workbench w(problem);
        BranchEngines branch(w.problem, *w.kkt);
        choose(branch, s_fixed);
        if (!branch.exact.solve(w.run, kBudget)) continue;
        expect_optimal(w, branch, problem.name);
        lowest = std::min(lowest, w.judged(branch.point.x.z()).objective);
      }
      EXPECT_NEAR(lowest, optimum, 1e-8 * (1.0 + std::abs(optimum))) << problem.name << ": the best branch";
    }
  }
}

TEST(ExactBranch, NeverTakesMoreFactorizationsThanItMay) {
  int short_of = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 16, .equalities = 2, .inequalities = 20, .pairs = 4}, seed);
    for (int budget = 0; budget <= 8; ++budget) {
      Workbench w(p);
      BranchEngines branch(w.problem, *w.kkt);
      choose(branch, 5);
      w.run.factorizations = 1000;  // of engines before
      const bool solved = branch.exact.solve(w.run, budget);
      EXPECT_LE(w.run.factorizations, 1000 + budget) << p.name;
      short_of += solved ? 0 : 1;
    }
  }
  EXPECT_GT(short_of, 20);
}

TEST(ExactBranch, DoesNothingForWhoIsToStop) {
  Rows rows;
  rows.source.request_stop();
  Workbench w(testing::random_problem({}, 1), {}, &rows);
  BranchEngines branch(w.problem, *w.kkt);
  branch.point.start_from_point(w.zero());
  EXPECT_FALSE(branch.exact.solve(w.run, kBudget));
  EXPECT_EQ(w.run.factorizations, 0);
}

TEST(ExactBranch, FromAnExactSolutionItIsThereAfterOneFactorization) {
  int read = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Workbench w(testing::random_problem({}, seed));
    BranchEngines branch(w.problem, *w.kkt);
    branch.point.start_from_point(w.zero());
    if (!branch.exact.solve(w.run, kBudget)) continue;
    const Iterate x = branch.point.x;
    const WorkingSet set = branch.point.set;
    int before = w.run.factorizations;
    int both_held = 0;
    for (Index pair = 0; pair < set.layout.pairs; ++pair) both_held += set.held[set.free_row(pair)];
    if (both_held == 0) {  // else either side may be
      ++read;
      branch.point.start_from_solution(x);
      EXPECT_TRUE(branch.point.set == set) << seed;
      ASSERT_TRUE(branch.exact.solve(w.run, kBudget));
      EXPECT_EQ(w.run.factorizations - before, 1) << seed;
    }
    // Elsewhere, and back.
    choose(branch, 10);
    static_cast<void>(branch.exact.solve(w.run, kBudget));
    branch.point.restore(x, set);
    EXPECT_EQ(branch.point.x.all, x.all);
    EXPECT_TRUE(branch.point.set == set);
    EXPECT_EQ(branch.point.images.objective, w.images(x).objective) << "images are those of the point";
    EXPECT_LE(branch.point.error(), 1e-9);
    before = w.run.factorizations;
    ASSERT_TRUE(branch.exact.solve(w.run, kBudget));
    EXPECT_EQ(w.run.factorizations - before, 1) << seed;
    EXPECT_LE(max_abs(branch.point.x.z() - x.z()), 1e-9) << seed;
  }
  EXPECT_GE(read, 10);
}

// Every solution falls short by two fifths: a few sweeps gain a few digits, no more.
class ShortKkt final : public testing::WrappedKkt {
 public:
  using WrappedKkt::WrappedKkt;
  [[nodiscard]] bool solve(VectorRef x, VectorRef y) override {
    const bool solved = WrappedKkt::solve(x, y);
    x *= 0.6;
    y *= 0.6;
    return solved;
  }
};

TEST(ExactBranch, CallsSolvedOnlyWhatIsExact) {
  int refused = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Workbench w(testing::random_problem({.variables = 12, .inequalities = 0}, seed));
    ShortKkt kkt(*w.kkt);
    BranchEngines branch(w.problem, kkt);
    branch.point.start_from_point(w.zero());
    const bool solved = branch.exact.solve(w.run, kBudget);
    EXPECT_TRUE(!solved || branch.point.error() <= 1e-9) << seed << ": " << branch.point.error();
    refused += solved ? 0 : 1;
  }
  EXPECT_GE(refused, 10);
}

// Exchanges of rows go one by one there, and so does Newton's method.
TEST(ExactBranch, ManyRowsThatChangeTakeNoMoreThanItsBudget) {
  Workbench w(testing::obstacle_problem(1000));
  BranchEngines branch(w.problem, *w.kkt);
  branch.point.start_from_point(w.zero());
  ASSERT_TRUE(branch.exact.solve(w.run, kBudget));
  EXPECT_LE(w.run.factorizations, kBudget);
  EXPECT_LE(branch.point.error(), 1e-9);
}

// 0 ≤ a x + b y ⊥ w ≥ 0 without a cost on x and y: rounding of the held rows' weight hides the proximal term
// along (b, −a), in one pair of some hundred.
TEST(ExactBranch, SolvesALargeBranchThatIsFlat) {
  constexpr Index kPairs = 1000;
  OwnedProblem p;
  Triplets Q, L, R;
  for (Index i = 0; i < kPairs; ++i) {
    Q.add(3 * i + 2, 3 * i + 2, 2.0);
    p.g.insert(p.g.end(), {0.0, 0.0, -2.0});
    L.add(i, 3 * i, 1.0 + std::fmod(0.37 * i, 1.0));
    L.add(i, 3 * i + 1, 1.0 + std::fmod(0.71 * i, 1.0));
    R.add(i, 3 * i + 2, 1.0);
  }
  p.Q = compress(3 * kPairs, 3 * kPairs, Q, "Q").value();
  p.L = compress(kPairs, 3 * kPairs, L, "L").value();
  p.R = compress(kPairs, 3 * kPairs, R, "R").value();
  p.l.assign(kPairs, 0.0);
  p.r = p.l;
  Workbench w(p, {.scaling_passes = 0});
  BranchEngines branch(w.problem, *w.kkt);
  for (Index pair = 0; pair < kPairs; ++pair) branch.point.set.fix(pair, true, false);
  ASSERT_TRUE(branch.exact.solve(w.run, kBudget));
  EXPECT_GE(w.run.factorizations, 2) << "the problem is to hide the proximal term";
  EXPECT_LE(w.run.factorizations, 4);
  expect_optimal(w, branch, "flat");
}

// One more variable x ≥ 0 whose cost is all but none: weakly active, and flat where that is not held.
// Newton's method is busy with the other rows.
TEST(ExactBranch, TakesTheInteriorPointsSolutionWhereItsRowsDoNotGiveItBack) {
  constexpr double kCost = 3e-9;
  OwnedProblem p = testing::obstacle_problem(1000);
  const Index x = p.Q.rows++;
  p.Q.columns++;
  p.Q.column_pointers.push_back(p.Q.column_pointers.back());
  p.g.push_back(kCost);
  p.C.rows++;
  p.C.columns++;
  p.C.row_indices.push_back(x);
  p.C.values.push_back(1.0);
  p.C.column_pointers.push_back(p.C.column_pointers.back() + 1);
  p.d.push_back(0.0);
  Workbench w(p, {.scaling_passes = 0});
  BranchEngines branch(w.problem, *w.kkt);
  branch.point.start_from_point(w.zero());
  branch.point.x.z()[x] = 1.0;
  ASSERT_TRUE(branch.exact.solve(w.run, kBudget));
  EXPECT_LE(w.run.factorizations, kBudget);
  EXPECT_LE(branch.point.violation(), 1e-9);
  const Images images = w.images(branch.point.x);
  EXPECT_LE(max_abs(images.stationarity), 1e-6);
  for (Index row = 0; row < w.problem.inequalities(); ++row) {
    EXPECT_LE(branch.point.x.lambda_w()[row], 1e-9) << row;
    EXPECT_NEAR(images.rows.inequality()[row] * branch.point.x.lambda_w()[row], 0.0, 1e-9) << row;
  }
}

}  // namespace
}  // namespace marble
