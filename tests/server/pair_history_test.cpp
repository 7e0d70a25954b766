#include "jobs/pair_history.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

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

}  // namespace
}  // namespace marble::server
