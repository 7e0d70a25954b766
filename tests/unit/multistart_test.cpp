// Starts elsewhere: where they look, and that they look nowhere twice.
#include "search/multistart.h"

#include <gtest/gtest.h>

#include <vector>

#include "branch/branch_engines.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Workbench;

constexpr Index kPairs = 20;
constexpr int kBudget = 1000;

// min ½‖(x, y)‖² − w² over 20 pairs 0 ≤ xᵢ ⊥ yᵢ ≥ 0 and −1 ≤ w ≤ 2: the pairs are 0 on every branch, and
// there are two local minima, −1 and −4.
OwnedProblem two_minima() {
  constexpr Index kVariables = 2 * kPairs + 1;
  OwnedProblem p;
  p.g.assign(kVariables, 0.0);
  std::vector<Index> each, pair, x, y;
  std::vector<double> diagonal(kVariables, 1.0);
  diagonal.back() = -2.0;
  for (Index j = 0; j < kVariables; ++j) each.push_back(j);
  for (Index i = 0; i < kPairs; ++i) {
    pair.push_back(i);
    x.push_back(2 * i);
    y.push_back(2 * i + 1);
  }
  const std::vector<double> ones(kPairs, 1.0);
  p.Q = compress(kVariables, kVariables, {each, each, diagonal}, "Q").value();
  p.C = compress(2, kVariables, {{0, 1}, {kVariables - 1, kVariables - 1}, {1.0, -1.0}}, "C").value();
  p.d = {1.0, 2.0};
  p.L = compress(kPairs, kVariables, {pair, x, ones}, "L").value();
  p.R = compress(kPairs, kVariables, {pair, y, ones}, "R").value();
  p.l = p.r = std::vector<double>(kPairs, 0.0);
  return p;
}

struct Elsewhere : Workbench {
  explicit Elsewhere(const OwnedProblem& p)
      : Workbench(p),
        branch(problem, *kkt),
        incumbent(problem, options, branch.exact),
        multistart(problem, *kkt, branch.point, incumbent) {}

  // The minimum at w = −1, with its bound held.
  void begin_at_the_higher_minimum() {
    Iterate x(problem);
    x.all.setZero();
    x.z()[problem.variables() - 1] = -1.0 / problem.variable_scale[problem.variables() - 1];
    WorkingSet set(problem);
    set.held[0] = 1;
    incumbent.offer(x, images(x), set, "the higher minimum");
  }
  [[nodiscard]] double objective() const { return judged(incumbent.best().x.z()).objective; }

  BranchEngines branch;
  Incumbent incumbent;
  Multistart multistart;
};

TEST(Multistart, MinimaSearchedBeforeAreSkipped) {
  Elsewhere e(two_minima());
  e.begin_at_the_higher_minimum();
  ASSERT_TRUE(e.incumbent.exists());
  int searched = 0, lower = 0;
  for (int start = 0; start < 12; ++start) {
    const int before = e.run.factorizations;
    lower += e.multistart.next(e.run, before + kBudget) ? 1 : 0;
    const int work = e.run.factorizations - before;
    // A search of the neighbours solves a projection and a descent of each.
    if (work >= 2 * kPairs)
      ++searched;
    else
      EXPECT_LT(work, kPairs) << "start " << start;
  }
  EXPECT_EQ(lower, 1);
  EXPECT_EQ(searched, 2) << "each minimum once";
  EXPECT_NEAR(e.objective(), -4.0, 1e-9);
}

}  // namespace
}  // namespace marble
