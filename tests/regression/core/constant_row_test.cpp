// A constant row 0·z ≥ 1e-9, as fixed variables leave behind, was infeasible with a certificate, from 1e-12
// on, while doubled rows that differ by as much are solved. Now what is violated by 1e-9 at most counts as 0.
#include <gtest/gtest.h>

#include <Eigen/Core>

#include "marble/solver.h"
#include "support/dense_matrix.h"

namespace marble {
namespace {

// min ½z² + z, z ≥ 0, with a row 0·z + offset ≥ 0 or = 0.
Solution solve_with_constant_row(double offset, bool equality) {
  OwnedProblem p;
  p.Q = testing::sparse(Eigen::MatrixXd::Constant(1, 1, 1.0));
  p.g = {1.0};
  Triplets rows;
  if (equality) {
    p.A = compress(1, 1, {}, "A").value();
    p.b = {offset};
    rows.add(0, 0, 1.0);
    p.d = {0.0};
  } else {
    rows.add(1, 0, 1.0);
    p.d = {offset, 0.0};
  }
  p.C = compress(static_cast<Index>(p.d.size()), 1, rows, "C").value();
  return Solver::create(Problem::create(p.view()).value()).value().solve().value();
}

TEST(ConstantRow, IsAcceptedWhereItsViolationIsRounding) {
  for (const bool equality : {false, true}) {
    for (const double offset : {-1e-9, -1e-11, -1e-15, 0.0}) {
      const Solution s = solve_with_constant_row(offset, equality);
      EXPECT_EQ(s.status, Status::solved) << offset << " " << s.detail;
      EXPECT_NEAR(s.z[0], 0.0, 1e-9);
    }
    EXPECT_EQ(solve_with_constant_row(-1e-3, equality).status, Status::infeasible);
  }
}

// 0 ≤ offset ⊥ z ≥ 0, and with 1 ≥ 0 in place of z: sides were held to more than rows of C.
TEST(ConstantRow, OfAPairIsAcceptedLikeOneOfC) {
  for (const double offset : {-1e-9, -1e-12, 0.0, 1e-9, 1e-7}) {
    for (const bool both : {false, true}) {
      OwnedProblem p;
      p.Q = testing::sparse(Eigen::MatrixXd::Constant(1, 1, 1.0));
      p.g = {-1.0};
      Triplets side;
      if (!both) side.add(0, 0, 1.0);
      p.L = compress(1, 1, {}, "L").value();
      p.R = compress(1, 1, side, "R").value();
      p.l = {offset}, p.r = {both ? 1.0 : 0.0};
      const Solution s = Solver::create(Problem::create(p.view()).value()).value().solve().value();
      EXPECT_EQ(s.status, Status::solved) << offset << " " << s.detail;
      if (offset > 0.0) continue;  // a side of 1e-7 may be zero too, and z with it
      EXPECT_NEAR(s.z[0], 1.0, 1e-9) << offset;
    }
  }
}

}  // namespace
}  // namespace marble
