// Small problems that are unbounded came back `solved`, exit 0, in local and in global mode, some of them at
// points from which the objective falls. Documented: `unbounded`, with a direction as certificate.
//
// A branch without an exact solution was left out by the tree over the pairs and by the check of the branches
// that meet in a point, whatever the reason. Now it is asked whether the objective falls along a ray of it.
#include <gtest/gtest.h>

#include "marble/solver.h"
#include "support/problem_builder.h"

namespace marble {
namespace {

using testing::ProblemBuilder;

// Along (0, 1).
OwnedProblem falls_from_the_corner() {
  return ProblemBuilder("falls from the corner", {-3.0, -1.0})
      .at_least({2.0, 0.0, 0.0})
      .at_least({-1.0, 3.0, 0.0})
      .pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0})
      .optimum(0.0)
      .problem;
}

// At x = −1 along (0, 1); (0, 0) is a local minimum.
OwnedProblem falls_elsewhere() {
  return ProblemBuilder("falls elsewhere", {0.0, -2.0})
      .quadratic(0, 0, 4.0)
      .pair({0.0, 2.0, 0.0}, {1.0, 0.0, 1.0})
      .optimum(0.0)
      .problem;
}

// The same with a pair one side of which is always 0.
OwnedProblem falls_beside_an_empty_side() {
  return ProblemBuilder("falls beside an empty side", {0.0, -1.0})
      .pair({3.0, 0.0, 0.0}, {0.0, 0.0, 0.0})
      .pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0})
      .optimum(0.0)
      .problem;
}

void expect_unbounded(const OwnedProblem& p, const Options& options) {
  const Solution s = solve_in_process(p.view(), options).value();
  EXPECT_EQ(s.status, Status::unbounded) << p.name << ": " << s.detail;
  ASSERT_EQ(s.certificate.size(), 2U) << p.name;
  EXPECT_NEAR(s.certificate[0], 0.0, 1e-9) << p.name;
  EXPECT_NEAR(s.certificate[1], 1.0, 1e-9) << p.name;
}

TEST(UnboundedBranch, IsFoundAndCertified) {
  Options global;
  global.global_search = true;
  for (const OwnedProblem& p : {falls_from_the_corner(), falls_elsewhere(), falls_beside_an_empty_side()}) {
    expect_unbounded(p, {});
    expect_unbounded(p, global);
  }
}

TEST(UnboundedBranch, IsFoundFromTheBranchesOfAPointAlone) {
  Options alone;
  alone.max_small_problem_nodes = 0;
  expect_unbounded(falls_from_the_corner(), alone);
}

TEST(UnboundedBranch, WithABoundHasItsOptimum) {
  OwnedProblem p = ProblemBuilder("bounded", {-3.0, -1.0})
                       .at_least({2.0, 0.0, 0.0})
                       .at_least({-1.0, 3.0, 0.0})
                       .at_least({0.0, -1.0, 10.0})
                       .pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0})
                       .optimum(-10.0)
                       .problem;
  const Solution s = solve_in_process(p.view(), {}).value();
  EXPECT_EQ(s.status, Status::solved) << s.detail;
  EXPECT_NEAR(s.objective, -10.0, 1e-9);
  EXPECT_TRUE(s.proved);
}

}  // namespace
}  // namespace marble
