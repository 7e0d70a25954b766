// A variable that only has to be somewhere on a ray was answered with 12,235,998.08, where the end of the
// ray, 1, is as good, and its rounding was so coarse that global mode did not call the answer proved.
//
// What is flat leaves the path's end anywhere. Of an answer that is far out the branch is solved again from
// 0.
#include <gtest/gtest.h>

#include "marble/solver.h"
#include "support/problem_builder.h"

namespace marble {
namespace {

TEST(FarAnswer, OfARayIsItsNearEnd) {
  const OwnedProblem p = testing::ProblemBuilder("ray", {2.0, 0.0, -3.0})
                             .quadratic(2, 2, 4.0)
                             .at_least({0.0, 0.0, 1.0, 5.0})
                             .pair({3.0, 0.0, 2.0, 11.0}, {0.0, 1.0, 0.0, -1.0})
                             .optimum(-9.680555555555555)
                             .problem;
  Options options;
  options.global_search = true;
  const Solution s = solve_in_process(p.view(), options).value();
  EXPECT_EQ(s.status, Status::solved);
  EXPECT_NEAR(s.objective, -9.680555555555555, 1e-9);
  EXPECT_LE(s.z[1], 10.0);
  EXPECT_TRUE(s.proved) << s.detail;
}

}  // namespace
}  // namespace marble
