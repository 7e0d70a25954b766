#include "log/log_writer.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <csignal>
#include <string>
#include <thread>

#include "support/child_process.h"

namespace marble::server {
namespace {

using testing::eventually;

class LogWriterTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(pipe2(ends_, O_CLOEXEC), 0);
    std::signal(SIGPIPE, SIG_IGN);  // as the server has it
  }
  void TearDown() override {
    close(ends_[0]);
    close(ends_[1]);
  }
  [[nodiscard]] int read_end() const { return ends_[0]; }
  [[nodiscard]] int write_end() const { return ends_[1]; }
  /// So many bytes, as they come.
  [[nodiscard]] std::string read_bytes(std::size_t count) const {
    std::string text(count, '\0');
    std::size_t have = 0;
    for (ssize_t got = 1; have < count && got > 0; have += static_cast<std::size_t>(got))
      got = read(read_end(), text.data() + have, count - have);
    return text;
  }

 private:
  int ends_[2] = {-1, -1};
};

TEST_F(LogWriterTest, WritesWhatItIsGivenInItsOrderAndAllOfItAtTheEnd) {
  std::string all;
  {
    LogWriter writer(write_end(), 1 << 20);
    for (int i = 0; i < 1000; ++i) {
      const std::string line = "line " + std::to_string(i) + '\n';
      all += line;
      writer.put(line, 0);
    }
  }
  EXPECT_EQ(read_bytes(all.size()), all);
}

TEST_F(LogWriterTest, BeyondItsBoundItDropsAndCounts) {
  LogWriter writer(write_end(), 100'000);
  const std::string line(999, 'x');
  for (int i = 0; i < 1000; ++i) writer.put(line + "\n", 0);
  EXPECT_GE(writer.dropped(), 800);  // a pipe holds 64 KiB
  EXPECT_TRUE(writer.backlog().stalls);
  EXPECT_EQ(writer.backlog().unreported, writer.dropped());
  const auto written = static_cast<std::size_t>(1000 - writer.dropped());
  EXPECT_EQ(read_bytes(1000 * written).size(), 1000 * written);
  EXPECT_TRUE(eventually([&] { return !writer.backlog().stalls; }));
  writer.put("reported\n", writer.backlog().unreported);
  EXPECT_EQ(writer.backlog().unreported, 0);
  EXPECT_GT(writer.dropped(), 0) << "since the beginning";
  EXPECT_EQ(read_bytes(9), "reported\n");
}

TEST_F(LogWriterTest, LinesOfAnyLengthAndADescriptorThatDoesNotBlock) {
  fcntl(write_end(), F_SETFL, O_NONBLOCK);
  std::string all;
  LogWriter writer(write_end(), 10 << 20);
  for (const std::size_t length : {std::size_t{1}, std::size_t{PIPE_BUF}, std::size_t{PIPE_BUF} + 1,
                                   std::size_t{1} << 20, std::size_t{2}}) {
    all += std::string(length - 1, 'x') + "\n";
    writer.put(std::string(length - 1, 'x') + "\n", 0);
  }
  EXPECT_EQ(read_bytes(all.size()), all);
  EXPECT_EQ(writer.dropped(), 0);
}

TEST_F(LogWriterTest, WhatCannotBeWrittenCountsAsDropped) {
  const int full = open("/dev/full", O_WRONLY | O_CLOEXEC);
  LogWriter writer(full, 1 << 20);
  writer.put("one\ntwo\n", 0);
  EXPECT_TRUE(eventually([&] { return writer.dropped() == 2; }));
  EXPECT_TRUE(writer.backlog().stalls) << "a line about it would be lost that line too";
  close(full);
}

TEST_F(LogWriterTest, AReaderThatStallsDoesNotHoldUpTheEnd) {
  const int copy = dup(write_end());  // its thread may wait on it to the end of this process
  {
    LogWriter writer(copy, 1 << 20);
    for (int i = 0; i < 100; ++i) writer.put(std::string(4095, 'x') + "\n", 0);
  }
  SUCCEED() << "it ended";
}

}  // namespace
}  // namespace marble::server
