#include "certificate.h"

#include <gtest/gtest.h>

#include "marble/solver.h"
#include "support/random_problem.h"

namespace marble {
namespace {

OwnedProblem one_variable(double gradient) {
  OwnedProblem p;
  p.g = {gradient};
  return p;
}

void add_inequality(OwnedProblem& p, const std::vector<std::pair<double, double>>& rows) {
  Triplets entries;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    entries.add(static_cast<Index>(i), 0, rows[i].first);
    p.d.push_back(rows[i].second);
  }
  p.C = compress(static_cast<Index>(rows.size()), 1, entries, "C").value();
}

TEST(Certificate, ContradictoryBoundsAreProvedInfeasible) {
  OwnedProblem p = one_variable(1.0);
  add_inequality(p, {{1.0, -2.0}, {-1.0, 1.0}});  // z ≥ 2 and z ≤ 1
  const Solution s = solve(p.view()).value();
  ASSERT_EQ(s.status, Status::infeasible) << s.detail;
  ASSERT_EQ(s.certificate.size(), 2U);
  // −Cᵀν = 0 and −dᵀν = 1 with ν ≥ 0: for every z, 0 ≤ νᵀ(Cz + d) = −1.
  EXPECT_GE(s.certificate[0], 0.0);
  EXPECT_GE(s.certificate[1], 0.0);
  EXPECT_NEAR(s.certificate[0] - s.certificate[1], 0.0, 1e-5);
  EXPECT_NEAR(2.0 * s.certificate[0] - s.certificate[1], 1.0, 1e-5);
}

TEST(Certificate, ALinearCostWithoutBoundIsUnboundedAndSaysWhere) {
  OwnedProblem p = one_variable(-1.0);
  add_inequality(p, {{1.0, 0.0}});  // z ≥ 0, min −z
  const Solution s = solve(p.view()).value();
  ASSERT_EQ(s.status, Status::unbounded) << s.detail;
  ASSERT_EQ(s.certificate.size(), 1U);
  EXPECT_DOUBLE_EQ(s.certificate[0], 1.0);
}

TEST(Certificate, FeasibleProblemsGetNone) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const OwnedProblem p = testing::random_problem({}, seed);
    const Solution s = solve(p.view()).value();
    EXPECT_NE(s.status, Status::infeasible) << seed;
    EXPECT_NE(s.status, Status::unbounded) << seed;
    EXPECT_TRUE(s.certificate.empty());
  }
}

}  // namespace
}  // namespace marble
