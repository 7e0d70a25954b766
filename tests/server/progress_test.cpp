#include <gtest/gtest.h>

#include <thread>

#include "jobs/pair_history.h"
#include "jobs/progress_history.h"
#include "jobs/progress_slot.h"
#include "service/job_feed.h"

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

PairHistory filled(int rows) {
  PairHistory history(128);
  for (int i = 0; i < rows; ++i) {
    const double s[] = {1.0 * i, 0.5}, t[] = {0.0, 2.0 * i};
    Progress progress;
    progress.iteration = i;
    progress.kappa = 1.0 / (1 + i);
    progress.s = s;
    progress.t = t;
    history.put(progress);
  }
  return history;
}

TEST(PairHistory, KeepsEveryFrameOfAShortSolve) {
  const auto frames = filled(5).frames();
  ASSERT_EQ(frames.size(), 5U);
  EXPECT_EQ(frames[3].iteration, 3);
  EXPECT_EQ(frames[3].s, (std::vector<float>{3.0F, 0.5F}));
  EXPECT_EQ(frames[3].t, (std::vector<float>{0.0F, 6.0F}));
}

TEST(PairHistory, SpreadsItsFramesEvenlyOverALongSolveAndKeepsTheNewest) {
  for (const int rows : {16, 17, 18, 33, 100, 1000, 4097}) {
    const auto frames = filled(rows).frames();
    ASSERT_LE(frames.size(), PairHistory::kMostFrames + 1) << rows;
    ASSERT_GE(frames.size(), PairHistory::kMostFrames / 2) << rows;
    EXPECT_EQ(frames.front().iteration, 0) << rows;
    EXPECT_EQ(frames.back().iteration, rows - 1) << rows;
    const int stride = frames[1].iteration;
    for (std::size_t i = 0; i + 1 < frames.size(); ++i)
      EXPECT_EQ(frames[i].iteration, static_cast<int>(i) * stride) << rows;
    for (const auto& frame : frames)
      EXPECT_EQ(frame.s, (std::vector<float>{static_cast<float>(frame.iteration), 0.5F})) << rows;
  }
}

TEST(PairHistory, OfManyPairsAnEvenSampleIsKeptTheSameInAllFrames) {
  constexpr std::size_t kPairs = 540;
  std::vector<double> s(kPairs), t(kPairs);
  for (std::size_t i = 0; i < kPairs; ++i) {
    s[i] = static_cast<double>(i);
    t[i] = -static_cast<double>(i);
  }
  PairHistory history(128);
  for (int iteration = 0; iteration < 3; ++iteration) {
    Progress progress;
    progress.iteration = iteration;
    progress.s = s;
    progress.t = t;
    history.put(progress);
  }
  for (const PairHistory::Frame& frame : history.frames()) {
    ASSERT_EQ(frame.s.size(), 128U);
    ASSERT_EQ(frame.t.size(), 128U);
    for (std::size_t k = 0; k < 128; ++k) {
      EXPECT_EQ(frame.s[k], static_cast<float>(k * kPairs / 128));
      EXPECT_EQ(frame.t[k], -frame.s[k]);
    }
    EXPECT_GT(frame.s[127], 530.0F) << "to the end";
  }
}

TEST(PairHistory, AnotherSolveBeginsEmpty) {
  PairHistory history = filled(40);
  history.begin();
  EXPECT_TRUE(history.empty());
  EXPECT_TRUE(history.frames().empty());
}

// What a feed of one job says of its end, while the job ends.
TEST(JobFeed, TellsTheEndOfAJobOnceWheneverItEnds) {
  JobBoard board({});
  FeedLimit limit(10);
  const Identity viewer{"client", {}};
  for (int round = 0; round < 3000; ++round) {
    const std::string id = "job" + std::to_string(round);
    const auto record = board.make({.id = id, .client = viewer.client}, {});
    board.add(record);
    record->queued();
    record->started(0.0);
    v1::WatchJobsRequest request;
    request.set_job_id(id);
    const auto feed = JobFeed::open(board, limit, viewer, {}, request).value();
    std::jthread solver([&] {
      Progress progress;
      for (progress.iteration = 0; progress.iteration < 5; ++progress.iteration) record->report(progress);
      record->finished(Solution(), 0.0, 0.0);
    });
    int finished = 0;
    for (bool ended = false; !ended || finished == 0;) {
      ended = record->is_finished();
      v1::WatchJobsResponse response;
      if (!feed->next(&response)) continue;
      ASSERT_EQ(response.events_size(), 1);
      finished += response.events(0).job().state() == v1::JOB_STATE_FINISHED ? 1 : 0;
      ASSERT_EQ(feed->is_over(), finished > 0) << "the stream goes on after its last event";
    }
    v1::WatchJobsResponse more;
    EXPECT_FALSE(feed->next(&more));
    ASSERT_EQ(finished, 1);
  }
}

}  // namespace
}  // namespace marble::server
