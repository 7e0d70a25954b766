#include "path/schedule.h"

#include <gtest/gtest.h>

#include "support/random_problem.h"

namespace marble {
namespace {

class ScheduleTest : public ::testing::Test {
 protected:
  OwnedProblem owned = testing::random_problem({}, 1);
  ScaledProblem problem = scale(Problem::create(owned.view()).value(), 10);
  Subproblem sub{problem};
  Iterate x{problem};
};

TEST_F(ScheduleTest, PaperRaisesRhoFirstThenLowersKappaAndTakesEstimates) {
  Options options;
  options.path = Path::paper;
  const Schedule schedule(options);
  schedule.begin(sub);
  EXPECT_EQ(sub.rho, options.rho_initial);
  EXPECT_EQ(sub.kappa, 0.1);
  x.all.setOnes();
  int raises = 0;
  while (sub.rho < options.rho_max) {
    schedule.advance(sub, x);
    EXPECT_EQ(sub.kappa, 0.1);
    EXPECT_EQ(sub.equality_estimate.sum(), 0.0);
    ++raises;
  }
  EXPECT_EQ(raises, 6);
  schedule.advance(sub, x);
  EXPECT_EQ(sub.kappa, 0.05);
  EXPECT_TRUE(sub.equality_estimate.isOnes() && sub.row_estimate.s().isOnes());
}

TEST_F(ScheduleTest, KappaNeverFallsBelowItsMinimum) {
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    options.rho_initial = options.rho_max;
    options.kappa_min = 1e-7;
    const Schedule schedule(options);
    schedule.begin(sub);
    for (int i = 0; i < 200; ++i) {
      schedule.advance(sub, x);
      EXPECT_GE(sub.kappa, 1e-7);
    }
    EXPECT_TRUE(schedule.exhausted(sub));
  }
}

TEST_F(ScheduleTest, FastLowersKappaSuperlinearly) {
  const Options options;
  const Schedule schedule(options);
  schedule.begin(sub);
  EXPECT_EQ(sub.kappa, 10.0);
  sub.kappa = 1e-4;
  schedule.advance(sub, x);
  EXPECT_DOUBLE_EQ(sub.kappa, 1e-6);
}

TEST_F(ScheduleTest, RetreatGoesHalfTheWayBackAndEndsWhenTooLittleIsLeft) {
  const Options options;
  const Schedule schedule(options);
  schedule.begin(sub);
  sub.kappa = 1e-6;
  EXPECT_TRUE(schedule.retreat(sub, 1e-4));
  EXPECT_DOUBLE_EQ(sub.kappa, 1e-5);
  int retreats = 0;
  while (schedule.retreat(sub, 1e-4)) ASSERT_LT(++retreats, 20);
}

TEST(Regularization, StartsAtTheFirstValueGoesUpByEightAndRemembers) {
  Regularization delta(Options{.path = Path::paper, .regularization_initial = 1e-4});
  delta.begin();
  EXPECT_EQ(delta.current(), 0.0);
  EXPECT_TRUE(delta.raise());
  EXPECT_DOUBLE_EQ(delta.current(), 1e-4);
  EXPECT_TRUE(delta.raise());
  EXPECT_DOUBLE_EQ(delta.current(), 8e-4);
  delta.accept();
  delta.begin();
  EXPECT_EQ(delta.current(), 0.0) << "every iteration tries without first";
  EXPECT_TRUE(delta.raise());
  EXPECT_DOUBLE_EQ(delta.current(), 8e-4 / 3.0);
}

TEST(Regularization, IsAlgorithmOnesWhereThatIsAskedFor) {
  Regularization delta(Options{.path = Path::algorithm1});
  for (int iteration = 0; iteration < 2; ++iteration) {
    delta.begin();
    EXPECT_EQ(delta.current(), 0.0);
    for (const double printed : {1e-2, 1e-1, 1.0}) {
      EXPECT_TRUE(delta.raise());
      EXPECT_DOUBLE_EQ(delta.current(), printed);
    }
    delta.accept();
  }
}

// From 1e-9 on, the fast path's least delta, it stayed at the first value for ever.
TEST(Regularization, GivesUpWithinABoundedNumberOfRaises) {
  for (const Path path : {Path::fast, Path::paper, Path::algorithm1}) {
    for (const double initial : {1e-12, 1e-9, 1e-4, 1e6}) {
      Regularization delta(Options{.path = path, .regularization_initial = initial});
      delta.begin();
      double last = delta.current();
      for (int raises = 0; delta.raise(); last = delta.current()) {
        ASSERT_GT(delta.current(), last);
        ASSERT_LT(++raises, 30);
      }
    }
  }
}

}  // namespace
}  // namespace marble
