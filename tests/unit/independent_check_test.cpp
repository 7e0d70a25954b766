// A judge that cannot condemn would make every other test pass: each fault must show, and only where it is.
#include "support/independent_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/small_problems.h"

namespace marble::testing {
namespace {

// min zᵀz, z₁ = 1, z₂ ≥ 1, 0 ≤ z₃ + 1 ⊥ z₄ − 1 ≥ 0 at its optimum (1, 1, 0, 1).
class Judge : public ::testing::Test {
 protected:
  Judge() {
    s.z = {1, 1, 0, 1};
    s.equality_multipliers = {-2};
    s.inequality_multipliers = {2};
    s.complementarity_multipliers_L = {0};
    s.complementarity_multipliers_R = {2};
  }
  [[nodiscard]] Verdict verdict() const { return judge(p.view(), s); }

  OwnedProblem p = public_example().problem;
  Solution s;
};

TEST_F(Judge, AcceptsTheOptimum) {
  const Verdict v = verdict();
  EXPECT_EQ(v.infeasibility(), 0.0);
  EXPECT_EQ(v.stationarity, 0.0);
  EXPECT_EQ(v.wrong_sign, 0.0);
  EXPECT_EQ(v.slackness, 0.0);
  EXPECT_EQ(v.objective, 3.0);
}

TEST_F(Judge, MeasuresEachViolation) {
  s.z = {1.25, 0.5, 0.5, 1.75};
  const Verdict v = verdict();
  EXPECT_DOUBLE_EQ(v.equality, 0.25);
  EXPECT_DOUBLE_EQ(v.inequality, 0.5);
  EXPECT_DOUBLE_EQ(v.complementarity, 0.75);  // s = 1.5, t = 0.75
  EXPECT_DOUBLE_EQ(v.infeasibility(), 0.75);
}

TEST_F(Judge, ANegativeSideOfAPairIsAViolation) {
  s.z[3] = 0.5;
  EXPECT_DOUBLE_EQ(verdict().complementarity, 0.5);
  s.z = {1, 1, -4, 1};
  EXPECT_DOUBLE_EQ(verdict().complementarity, 3.0);
}

TEST_F(Judge, MeasuresStationarityAgainstTheLargestTerm) {
  s.equality_multipliers = {-1};
  EXPECT_DOUBLE_EQ(verdict().stationarity, 1.0 / 3.0);  // 2 − 1, its largest term is 2
}

TEST_F(Judge, SeesAMultiplierOfTheWrongSign) {
  s.inequality_multipliers = {-2};
  EXPECT_DOUBLE_EQ(verdict().wrong_sign, 2.0);
  EXPECT_GT(verdict().stationarity, 0.1);
}

TEST_F(Judge, SeesAMultiplierOfAnInactiveRow) {
  s.z = {1, 2, 0, 1};
  EXPECT_DOUBLE_EQ(verdict().slackness, 2.0 / 3.0);
  s.z = {1, 1, 0, 1};
  s.complementarity_multipliers_L = {1};
  EXPECT_DOUBLE_EQ(verdict().slackness, 1.0 / 3.0);
  s.complementarity_multipliers_L = {0};
  s.z[3] = 4.0;
  EXPECT_DOUBLE_EQ(verdict().slackness, 2.0);
}

TEST_F(Judge, NanIsTheWorstOfAll) {
  s.z[1] = std::nan("");
  EXPECT_EQ(verdict().inequality, std::numeric_limits<double>::infinity());
  EXPECT_EQ(verdict().stationarity, std::numeric_limits<double>::infinity());
  EXPECT_EQ(verdict().infeasibility(), std::numeric_limits<double>::infinity());
}

TEST_F(Judge, ReadsEitherFormOfQ) {
  p.Q = compress(4, 4, {{0, 0, 1, 1, 2, 3}, {0, 1, 0, 1, 2, 3}, {2, 1, 1, 2, 2, 2}}, "Q").value();
  const Verdict full = verdict();
  p.Q = compress(4, 4, {{0, 0, 1, 2, 3}, {0, 1, 1, 2, 3}, {2, 1, 2, 2, 2}}, "Q").value();
  p.hessian_form = HessianForm::upper_triangle;
  EXPECT_EQ(full.objective, 4.0);
  EXPECT_EQ(verdict().objective, full.objective);
  EXPECT_EQ(verdict().stationarity, full.stationarity);
  EXPECT_GT(full.stationarity, 0.0);
}

}  // namespace
}  // namespace marble::testing
