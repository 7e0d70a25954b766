#include "job_queue.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

TEST(JobQueue, GivesBackInTheOrderOfArrival) {
  JobQueue<int> queue(3);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(queue.push(std::make_shared<int>(i)), static_cast<std::size_t>(i));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(*queue.pop(), i);
  EXPECT_EQ(queue.pop(), nullptr);
}

TEST(JobQueue, RefusesWhenFullAndTakesAgainWhenThereIsRoom) {
  JobQueue<int> queue(1);
  ASSERT_TRUE(queue.push(std::make_shared<int>(1)));
  EXPECT_TRUE(queue.full());
  EXPECT_FALSE(queue.push(std::make_shared<int>(2)));
  EXPECT_EQ(*queue.pop(), 1);
  EXPECT_EQ(queue.push(std::make_shared<int>(3)), 0U);
  EXPECT_EQ(*queue.pop(), 3);
}

TEST(JobQueue, RemovesOneThatWaitsAndKeepsTheOrderOfTheRest) {
  JobQueue<int> queue(3);
  const auto middle = std::make_shared<int>(1);
  ASSERT_TRUE(queue.push(std::make_shared<int>(0)));
  ASSERT_TRUE(queue.push(middle));
  ASSERT_TRUE(queue.push(std::make_shared<int>(2)));
  EXPECT_TRUE(queue.remove(middle.get()));
  EXPECT_FALSE(queue.remove(middle.get())) << "it waits no more";
  EXPECT_EQ(queue.size(), 2U);
  EXPECT_EQ(*queue.pop(), 0);
  EXPECT_EQ(*queue.pop(), 2);
}

TEST(JobQueue, HoldsNothingAtCapacityZero) {
  JobQueue<int> queue(0);
  EXPECT_FALSE(queue.push(std::make_shared<int>(1)));
}

}  // namespace
}  // namespace marble::server
