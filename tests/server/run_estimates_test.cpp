// How long jobs are said to take, on simulated time.
#include "jobs/run_estimates.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

const RunEstimates::Key kPlanner{"planner", Priority::interactive, 1};

RunEstimates::Time second(double time_s) {
  const std::chrono::duration<double> after(time_s);
  return RunEstimates::Time() + std::chrono::duration_cast<RunEstimates::Time::duration>(after);
}

TEST(RunEstimates, KnowsNothingAtFirst) {
  RunEstimates estimates;
  EXPECT_EQ(estimates.mean_s(kPlanner), 0.0);
  EXPECT_EQ(estimates.likely_s(kPlanner), 0.0);
  EXPECT_TRUE(estimates.is_old(kPlanner, second(0)));
}

TEST(RunEstimates, FollowsWhatRunsTake) {
  RunEstimates estimates;
  for (int i = 0; i < 100; ++i) estimates.ran(kPlanner, 0.02, second(i));
  EXPECT_NEAR(estimates.mean_s(kPlanner), 0.02, 1e-9);
  EXPECT_NEAR(estimates.likely_s(kPlanner), 0.02, 1e-6);
  for (int i = 0; i < 100; ++i) estimates.ran(kPlanner, 0.2, second(100 + i));
  EXPECT_NEAR(estimates.mean_s(kPlanner), 0.2, 1e-3);
}

TEST(RunEstimates, AllowsForWhatRunsVaryBy) {
  RunEstimates estimates;
  for (int i = 0; i < 200; ++i) estimates.ran(kPlanner, i % 2 == 0 ? 0.01 : 0.03, second(i));
  EXPECT_NEAR(estimates.mean_s(kPlanner), 0.02, 2e-3);
  EXPECT_GE(estimates.likely_s(kPlanner), 0.027);
}

TEST(RunEstimates, OfAClientThatIsNewAreThoseOfAllOthers) {
  RunEstimates estimates;
  estimates.ran(kPlanner, 0.5, second(0));
  EXPECT_EQ(estimates.mean_s({"another", Priority::interactive, 1}), 0.5);
  EXPECT_EQ(estimates.mean_s({"another", Priority::interactive, 2}), 0.0) << "another class of work";
  EXPECT_EQ(estimates.mean_s({"another", Priority::batch, 1}), 0.0) << "another priority";
}

TEST(RunEstimates, ARunThatWasStoppedSaysOnlyThatItWouldHaveTakenLonger) {
  RunEstimates estimates;
  for (int i = 0; i < 50; ++i) estimates.ran(kPlanner, 0.2, second(i));
  estimates.cut(kPlanner, 0.01, second(50));
  EXPECT_NEAR(estimates.mean_s(kPlanner), 0.2, 1e-9);
  for (int i = 0; i < 50; ++i) estimates.cut(kPlanner, 1.0, second(51 + i));
  EXPECT_GE(estimates.mean_s(kPlanner), 0.9);
}

TEST(RunEstimates, SoonForgetWhatWasOfOtherWork) {
  RunEstimates estimates;
  for (int i = 0; i < 50; ++i) estimates.cut(kPlanner, 10.0, second(i));
  for (int i = 0; i < 8; ++i) estimates.ran(kPlanner, 0.02, second(50 + i));
  EXPECT_LT(estimates.likely_s(kPlanner), 0.2);
}

// One slow run, as of a machine that was stopped, and every job after it would be refused.
TEST(RunEstimates, AnOldEstimateIsTriedAgainstOnceInAWhile) {
  RunEstimates estimates;
  estimates.ran(kPlanner, 60.0, second(0));
  EXPECT_FALSE(estimates.is_old(kPlanner, second(0.5)));
  EXPECT_TRUE(estimates.is_old(kPlanner, second(1.5)));
  estimates.tries(kPlanner, second(1.5));
  EXPECT_FALSE(estimates.is_old(kPlanner, second(1.6))) << "one is enough";
  EXPECT_FALSE(estimates.is_old(kPlanner, second(3.4))) << "twice as long after a try that did not end";
  EXPECT_TRUE(estimates.is_old(kPlanner, second(3.5)));
  estimates.tries(kPlanner, second(3.5));
  EXPECT_FALSE(estimates.is_old(kPlanner, second(7.4)));
  for (int k = 0; k < 100; ++k) estimates.tries(kPlanner, second(10));
  EXPECT_TRUE(estimates.is_old(kPlanner, second(26))) << "never longer than 16 s";
  estimates.cut(kPlanner, 70.0, second(26));
  EXPECT_FALSE(estimates.is_old(kPlanner, second(41)));
  estimates.ran(kPlanner, 0.01, second(41));
  EXPECT_TRUE(estimates.is_old(kPlanner, second(42))) << "one has ended";
}

TEST(RunEstimates, AreBounded) {
  RunEstimates estimates;
  for (int i = 0; i < 10000; ++i)
    estimates.ran({"client" + std::to_string(i), Priority::interactive, 0}, 1.0, second(i));
  EXPECT_LE(estimates.size(), RunEstimates::kMost);
  EXPECT_EQ(estimates.mean_s({"client9999", Priority::interactive, 0}), 1.0);
}

}  // namespace
}  // namespace marble::server
