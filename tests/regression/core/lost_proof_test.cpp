// With `global_search` bard1, ex9_2_1 and ex9_2_7 ended "not proved: bound 2" at their optimum of 17, no node
// open. Documented: all of MacMPEC is proved.
//
// A proximal step that reaches a row is not one along what is flat. It was lengthened all the same, by its
// curvature, which was rounding: to points of size 1e15, where no bound was left.
#include <gtest/gtest.h>

#include "marble/solver.h"
#include "support/small_problems.h"

namespace marble {
namespace {

TEST(LostProof, OfSmallConvexProblemsAllAreProved) {
  Options options;
  options.global_search = true;
  int convex = 0;
  for (const auto& problems : {testing::small_problems(), testing::known_problems()}) {
    for (const auto& [problem, optimum] : problems) {
      const Solution s = solve_in_process(problem.view(), options).value();
      if (s.detail.find("Q is not convex") != std::string::npos) continue;
      ++convex;
      EXPECT_TRUE(s.proved) << problem.name << " " << s.detail;
    }
  }
  EXPECT_GE(convex, 50);
}

}  // namespace
}  // namespace marble
