#include "path/termination.h"

#include <gtest/gtest.h>

#include <limits>

#include "random_setting.h"

namespace marble {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(WithinTolerances, AsksEachViolationItsOwnTolerance) {
  Options options;
  options.equality_tolerance = 1e-3;
  options.inequality_tolerance = 1e-4;
  options.complementarity_tolerance = 1e-5;
  EXPECT_TRUE(within_tolerances({1e-3, 1e-4, 1e-5}, options));
  EXPECT_FALSE(within_tolerances({2e-3, 0.0, 0.0}, options));
  EXPECT_FALSE(within_tolerances({0.0, 2e-4, 0.0}, options));
  EXPECT_FALSE(within_tolerances({0.0, 0.0, 2e-5}, options));
  EXPECT_TRUE(within_tolerances({2e-3, 2e-4, 2e-5}, options, 2.0));
  EXPECT_FALSE(within_tolerances({kNan, 0.0, 0.0}, options));
  EXPECT_FALSE(within_tolerances({0.0, kNan, 0.0}, options));
  EXPECT_FALSE(within_tolerances({0.0, 0.0, kNan}, options));
}

TEST(StallDetector, IsPatientWhileTheViolationFalls) {
  StallDetector stall;
  double violation = 1.0;
  for (int i = 0; i < 500; ++i) EXPECT_FALSE(stall.stalled(violation *= 0.85));
}

TEST(StallDetector, SpeaksUpWithinABoundedNumberOfRounds) {
  for (const double drift : {1.0, 0.9999, 1.01}) {
    StallDetector stall;
    double violation = 1.0;
    int rounds = 0;
    while (!stall.stalled(violation *= drift)) ASSERT_LT(++rounds, 200) << drift;
    EXPECT_GT(rounds, 3);
  }
  StallDetector stall;
  int rounds = 0;
  while (!stall.stalled(kNan)) ASSERT_LT(++rounds, 200);
}

class ExplainEnd : public ::testing::Test {
 protected:
  [[nodiscard]] Status status(const Violations& violations, double residual_norm, bool stalled) const {
    return explain_end(setting.problem, options, setting.x, violations, residual_norm, stalled).status;
  }
  testing::Setting setting{{}, 1};
  Options options;
};

TEST_F(ExplainEnd, CallsAnAlmostFeasiblePointSolvedToReducedAccuracy) {
  EXPECT_EQ(status({5e-5, 5e-5, 5e-5}, 1e-4, true), Status::almost_solved);
  EXPECT_EQ(status({5e-5, 5e-5, 5e-5}, 1e-4, false), Status::almost_solved);
}

TEST_F(ExplainEnd, CallsAStalledViolationLocallyInfeasible) {
  EXPECT_EQ(status({0.0, 0.0, 0.1}, 1e-9, true), Status::locally_infeasible);
}

TEST_F(ExplainEnd, CallsEverythingElseAFailure) {
  EXPECT_EQ(status({0.0, 0.0, 0.1}, 1e-9, false), Status::numerical_failure);
  EXPECT_EQ(status({0.0, 0.0, 0.0}, 1.0, false), Status::numerical_failure)
      << "feasible, far from stationary";
}

TEST_F(ExplainEnd, NeverCallsANumberlessPointSolved) {
  EXPECT_FALSE(is_solved(status({kNan, 0.0, 0.0}, 1e-9, true)));
  EXPECT_FALSE(is_solved(status({0.0, 0.0, 0.0}, kNan, true)));
}

TEST_F(ExplainEnd, GivesTheNumbers) {
  const Ending ending = explain_end(setting.problem, options, setting.x, {0.125, 0.25, 0.5}, 0.75, true);
  for (const char* number : {"1.25e-01", "2.50e-01", "5.00e-01", "7.50e-01"})
    EXPECT_NE(ending.detail.find(number), std::string::npos) << ending.detail;
  EXPECT_TRUE(ending.certificate.empty());
}

}  // namespace
}  // namespace marble
