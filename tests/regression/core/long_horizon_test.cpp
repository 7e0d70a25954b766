// A hopper's plan of 480 steps was `solved` at an objective of 890,338, where a coupled solve of eight
// segments ends at 289.09; one of 240 steps at 154.2 in place of 138.6.
//
// A local search of the whole has hundreds of pairs that pull, and spent its budget far from any plan.
#include <gtest/gtest.h>

#include "marble/examples.h"
#include "marble/solver.h"
#include "support/independent_check.h"

namespace marble {
namespace {

void expect_plan(int steps, double objective_in_segments) {
  examples::HopperParameters parameters;
  parameters.steps = steps;
  const OwnedProblem p = examples::hopper(parameters);
  const Solution s = solve_in_process(p.view()).value();
  EXPECT_EQ(s.status, Status::solved) << s.detail;
  EXPECT_LE(s.objective, 1.05 * objective_in_segments);
  EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-9);
}

TEST(LongHorizon, APlanOf240StepsIsNearTheOneInSegments) { expect_plan(240, 138.56); }
TEST(LongHorizon, APlanOf480StepsIsNearTheOneInSegments) { expect_plan(480, 289.09); }

}  // namespace
}  // namespace marble
