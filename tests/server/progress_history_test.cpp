#include "jobs/progress_history.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

Progress row(int iteration) {
  Progress progress;
  progress.iteration = iteration;
  return progress;
}

ProgressHistory filled(int trace_rows, int rows) {
  ProgressHistory history(trace_rows);
  for (int i = 0; i < rows; ++i) history.put(row(i));
  return history;
}

TEST(ProgressHistory, KeepsEveryRowOfAShortSolve) {
  const auto trace = filled(10, 10).trace();
  ASSERT_EQ(trace.size(), 10U);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(trace[static_cast<std::size_t>(i)].iteration, i);
}

TEST(ProgressHistory, ThinsALongOneEvenlyAndKeepsTheNewest) {
  for (const int rows : {11, 12, 100, 1000, 12'345}) {
    const ProgressHistory history = filled(10, rows);
    const auto trace = history.trace();
    ASSERT_LE(trace.size(), 11U) << rows;
    ASSERT_GE(trace.size(), 5U) << rows;
    for (std::size_t i = 0; i + 1 < trace.size(); ++i)
      EXPECT_EQ(trace[i].iteration, static_cast<int>(i) * history.stride()) << rows;
    EXPECT_EQ(trace.back().iteration, rows - 1);
  }
}

TEST(ProgressHistory, WithoutATraceThereAreOnlyRecentRows) {
  const ProgressHistory history = filled(0, 7);
  EXPECT_TRUE(history.trace().empty());
  std::int64_t cursor = 0;
  EXPECT_EQ(history.read(cursor).rows.size(), 7U);
}

TEST(ProgressHistory, AReaderGetsEachRowOnceOrIsReportedHowManyItMissed) {
  ProgressHistory history(10);
  std::int64_t cursor = 0, seen = 0, skipped = 0;
  int next = 0;
  for (const int burst : {3, 0, 128, 129, 1, 1000, 5}) {
    for (int i = 0; i < burst; ++i) history.put(row(next++));
    const auto taken = history.read(cursor);
    for (std::size_t i = 0; i < taken.rows.size(); ++i)
      EXPECT_EQ(taken.rows[i].iteration, next - static_cast<int>(taken.rows.size()) + static_cast<int>(i));
    seen += static_cast<std::int64_t>(taken.rows.size());
    skipped += taken.skipped;
    EXPECT_EQ(seen + skipped, next) << "after a burst of " << burst;
  }
  EXPECT_GT(skipped, 0);
}

TEST(ProgressHistory, AnotherSolveHasATraceOfItsOwnAndCursorsGoOn) {
  ProgressHistory history = filled(4, 100);
  std::int64_t cursor = history.count();
  history.begin();
  EXPECT_TRUE(history.trace().empty());
  history.put(row(0));
  history.put(row(1));
  EXPECT_EQ(history.stride(), 1);
  EXPECT_EQ(history.trace().size(), 2U);
  EXPECT_EQ(history.read(cursor).rows.size(), 2U);
}

}  // namespace
}  // namespace marble::server
