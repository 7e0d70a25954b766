#include "jobs/wait_estimate.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

TEST(WaitEstimate, AJobTakesHalfOfTheMeanUntilItHasRunForLonger) {
  EXPECT_EQ(time_left_s(2.0, 0.1, 1e9), 1.0);
  EXPECT_EQ(time_left_s(2.0, 58.0, 1e9), 58.0) << "as long again";
  EXPECT_EQ(time_left_s(0.0, 58.0, 1e9), 58.0) << "whatever others took";
}

TEST(WaitEstimate, AJobEndsByItsTimeLimit) {
  EXPECT_EQ(time_left_s(2.0, 58.0, 3.0), 3.0);
  EXPECT_EQ(time_left_s(2.0, 58.0, -1.0), 0.0) << "over, but not yet seen to be";
}

TEST(WaitEstimate, TheFirstWorkerThatIsFreeCounts) {
  EXPECT_EQ(wait_for_worker_s({0.0, 100.0}, 0.0), 0.0);
  EXPECT_EQ(wait_for_worker_s({2.0, 100.0}, 0.0), 2.0) << "one long job keeps nobody else";
  EXPECT_EQ(wait_for_worker_s({60.0, 60.0}, 0.0), 60.0);
}

TEST(WaitEstimate, WorkAheadIsSharedByThoseThatAreFreeByThen) {
  EXPECT_EQ(wait_for_worker_s({1.0, 1.0}, 4.0), 3.0);
  EXPECT_EQ(wait_for_worker_s({1.0, 2.0, 100.0}, 5.0), 4.0);
}

}  // namespace
}  // namespace marble::server
