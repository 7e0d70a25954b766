#include "jobs/progress_slot.h"

#include <gtest/gtest.h>

#include <thread>

namespace marble::server {
namespace {

constexpr int kMostRows = static_cast<int>(ProgressSlot::kMostRows);

void put(ProgressSlot& slot, int iteration, bool with_iterate = false) {
  const std::vector<double> z = {1.0 * iteration, -1.0 * iteration};
  Progress progress;
  progress.iteration = iteration;
  progress.z = z;
  slot.put(progress, with_iterate);
}

TEST(ProgressSlot, IsEmptyBeforeTheFirstRowAndAfterATake) {
  ProgressSlot slot;
  EXPECT_TRUE(slot.take().rows.empty());
  put(slot, 0);
  EXPECT_EQ(slot.take().rows.size(), 1U);
  EXPECT_TRUE(slot.take().rows.empty());
}

TEST(ProgressSlot, GivesRowsOldestFirst) {
  ProgressSlot slot;
  for (int i = 0; i < 5; ++i) put(slot, i);
  const auto taken = slot.take();
  ASSERT_EQ(taken.rows.size(), 5U);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(taken.rows[static_cast<std::size_t>(i)].iteration, i);
  EXPECT_EQ(taken.skipped, 0);
}

TEST(ProgressSlot, DropsTheOldestRowsWhenFullAndCountsThem) {
  ProgressSlot slot;
  for (int i = 0; i < kMostRows + 7; ++i) put(slot, i);
  const auto taken = slot.take();
  ASSERT_EQ(taken.rows.size(), ProgressSlot::kMostRows);
  EXPECT_EQ(taken.rows.front().iteration, 7);
  EXPECT_EQ(taken.rows.back().iteration, kMostRows + 6);
  EXPECT_EQ(taken.skipped, 7);
}

TEST(ProgressSlot, KeepsTheCountOfDroppedRowsOverTakes) {
  ProgressSlot slot;
  for (int i = 0; i < kMostRows + 2; ++i) put(slot, i);
  const auto first = slot.take();
  EXPECT_EQ(first.skipped, 2);
  EXPECT_EQ(first.newly_skipped, 2);
  for (int i = 0; i < 3; ++i) put(slot, i);
  const auto taken = slot.take();
  ASSERT_EQ(taken.rows.size(), 3U);
  EXPECT_EQ(taken.rows.front().iteration, 0);
  EXPECT_EQ(taken.skipped, 2);
  EXPECT_EQ(taken.newly_skipped, 0);
}

TEST(ProgressSlot, CopiesTheIterateOfTheNewestRowOnlyWhenAsked) {
  ProgressSlot slot;
  put(slot, 3, true);
  EXPECT_EQ(slot.take().newest_z, (std::vector<double>{3.0, -3.0}));
  put(slot, 4, true);
  put(slot, 5, false);
  EXPECT_TRUE(slot.take().newest_z.empty());
}

TEST(ProgressSlot, LosesNothingUncountedBetweenTwoThreads) {
  ProgressSlot slot;
  constexpr int kRows = 20'000;
  std::thread worker([&] {
    for (int i = 0; i < kRows; ++i) put(slot, i, i % 100 == 0);
  });
  std::int64_t reported = 0, skipped = 0;
  int last = -1;
  while (last != kRows - 1) {
    const auto taken = slot.take();
    for (const Progress& row : taken.rows) {
      EXPECT_GT(row.iteration, last);
      last = row.iteration;
    }
    reported += static_cast<std::int64_t>(taken.rows.size());
    skipped = taken.skipped;
  }
  worker.join();
  EXPECT_EQ(reported + skipped, kRows);
}

TEST(ProgressSlot, AFirstRowIsDueAtOnceAndThoseSoonAfterItTogether) {
  ProgressSlot slot;
  EXPECT_FALSE(slot.due());
  put(slot, 0);
  EXPECT_TRUE(slot.due());
  ASSERT_EQ(slot.take().rows.size(), 1U);
  put(slot, 1);  // due now only if this thread was held up for longer than rows wait
  std::this_thread::sleep_for(ProgressSlot::kTogetherFor);
  EXPECT_TRUE(slot.due());
  EXPECT_EQ(slot.take().rows.size(), 1U);
}

TEST(ProgressSlot, ManyRowsAreDueBeforeTheirTime) {
  ProgressSlot slot;
  put(slot, 0);
  static_cast<void>(slot.take());
  for (std::size_t i = 0; i < ProgressSlot::kTogether; ++i) put(slot, static_cast<int>(i) + 1);
  EXPECT_TRUE(slot.due());
}

TEST(ProgressSlot, ARowWithItsIterateIsDueAtOnce) {
  ProgressSlot slot;
  put(slot, 0);
  static_cast<void>(slot.take());
  put(slot, 1, true);
  EXPECT_TRUE(slot.due());
}

TEST(ProgressSlot, AnotherSolvesFirstRowIsDueAtOnce) {
  ProgressSlot slot;
  put(slot, 0);
  static_cast<void>(slot.take());
  slot.reset();
  put(slot, 0);
  EXPECT_TRUE(slot.due());
}

}  // namespace
}  // namespace marble::server
