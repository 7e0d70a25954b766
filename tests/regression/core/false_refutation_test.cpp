// Two boxes with masses 1 and 10¹⁰ at rest were `infeasible`, `proved`, and with masses of 1 and 10⁸
// `locally_infeasible` after 5,900 factorizations: their forces are 10⁸, and the last digits of the matrix
// decide. A positive definite complementarity problem has a solution whatever its right-hand side is.
//
// What a node's contradiction left where no row bounds z was accepted up to 10⁻⁹; and no engine works beyond
// a condition of 10⁸. Now it must be rounding, and Lemke's method goes on in twice the precision.
#include <gtest/gtest.h>

#include "marble/solver.h"
#include "support/ill_conditioned.h"
#include "support/independent_check.h"

namespace marble {
namespace {

using testing::ill_conditioned_lcp;

TEST(FalseRefutation, TwoBoxesRestWhateverTheirMassesAre) {
  for (const double ratio : {1e4, 1e7, 1e8, 1e9, 1e10}) {
    const OwnedProblem p = testing::stacked_boxes(ratio);
    const Solution s = solve_in_process(p.view(), {}).value();
    EXPECT_EQ(s.status, Status::solved) << ratio << ": " << s.detail;
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << ratio;
    ASSERT_EQ(s.z.size(), 2U);
    EXPECT_NEAR(s.z[1] / (0.00981 * ratio), 1.0, 1e-6) << ratio;
  }
}

// By the largest eigenvalue 1 and the least: in doubles down to 1e-9, and never said to be infeasible below.
TEST(FalseRefutation, NoPositiveDefiniteComplementarityProblemIsInfeasible) {
  for (const bool far : {false, true}) {
    for (const double smallest : {1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12}) {
      int solved = 0;
      constexpr int kSeeds = 40;
      for (int seed = 1; seed <= kSeeds; ++seed) {
        const OwnedProblem p = ill_conditioned_lcp(smallest, static_cast<std::uint64_t>(seed), far);
        const Solution s = solve_in_process(p.view(), {}).value();
        EXPECT_NE(s.status, Status::infeasible) << p.name << " " << smallest << ": " << s.detail;
        EXPECT_NE(s.status, Status::unbounded) << p.name << " " << smallest << ": " << s.detail;
        if (s.status != Status::solved) continue;
        ++solved;
        EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << p.name << " " << smallest;
      }
      EXPECT_GE(solved, smallest >= 1e-9 ? 0.95 * kSeeds : 0.5 * kSeeds) << smallest << (far ? " far" : "");
    }
  }
}

}  // namespace
}  // namespace marble
