// What option starts relies on where Q is not convex.
#include "search/multistart.h"

#include <gtest/gtest.h>

#include "branch/branch_engines.h"
#include "support/problems/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

TEST(Multistart, AMinimumThatIsFoundAgainIsNotSearchedAgain) {
  int solved = 0;
  int again = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    testing::Workbench w(testing::random_problem(
        {.variables = 12, .equalities = 0, .inequalities = 24, .pairs = 8, .indefinite = true}, seed));
    BranchEngines branch(w.problem, *w.kkt);
    Incumbent incumbent(w.problem, w.options, branch.exact);
    branch.point.start_from_point(w.zero());
    if (incumbent.solve_branch(w.run, "", 100) != Incumbent::Outcome::kept) continue;
    ++solved;
    Multistart elsewhere(w.problem, *w.kkt, branch.point, incumbent);
    for (int start = 0; start < 60; ++start) {
      const int before = w.run.factorizations;
      const double objective = incumbent.best().objective;
      const bool better = elsewhere.next(w.run, before + 10'000);
      EXPECT_EQ(better, incumbent.best().objective < objective);
      // A neighbour takes its nearest point and a descent: two at least.
      const bool searched = w.run.factorizations - before >= 2 * w.problem.pairs();
      again += searched ? 0 : 1;
    }
  }
  EXPECT_GT(solved, 0);
  EXPECT_GT(again, 10 * solved);
}

}  // namespace
}  // namespace marble
