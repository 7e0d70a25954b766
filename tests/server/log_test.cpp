#include "log/log.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <csignal>
#include <string>
#include <thread>

#include "log/log_limit.h"
#include "log/log_writer.h"
#include "support/child_process.h"

namespace marble::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr LogEvent kRefused = {spdlog::level::info, Component::admission, "refused"};
constexpr LogEvent kJob = {spdlog::level::info, Component::job, "job"};

class LogLimitTest : public ::testing::Test {
 protected:
  LogLimitTest() { limit_.set_rate(10.0); }

  /// Of so many lines at once, those that pass; what each says was suppressed is added up.
  int passing(const LogEvent& event, const std::string& client, int lines) {
    int result = 0;
    for (int i = 0; i < lines; ++i) {
      const auto verdict = limit_.ask(event, client, now_);
      result += verdict.passes ? 1 : 0;
      reported_ += verdict.suppressed;
    }
    return result;
  }
  std::int64_t unreported() {
    std::int64_t lines = 0;
    for (const auto& one : limit_.take_all()) lines += one.lines;
    return lines;
  }

  LogLimit limit_;
  LogLimit::Time now_{std::chrono::hours(1)};
  std::int64_t reported_ = 0;
};

TEST_F(LogLimitTest, LetsThroughASecondsWorthAtOnceAndThenTheRate) {
  EXPECT_EQ(passing(kRefused, "a", 1000), 10);
  now_ += milliseconds(500);
  EXPECT_EQ(passing(kRefused, "a", 1000), 5);
  now_ += seconds(60);
  EXPECT_EQ(passing(kRefused, "a", 1000), 10) << "a long silence saves no more than a second's worth";
}

TEST_F(LogLimitTest, TheNextLineThatPassesReportsHowManyDidNot) {
  EXPECT_EQ(passing(kRefused, "a", 25), 10);
  now_ += milliseconds(100);
  const auto next = limit_.ask(kRefused, "a", now_);
  EXPECT_TRUE(next.passes);
  EXPECT_EQ(next.suppressed, 15);
  now_ += milliseconds(100);
  EXPECT_EQ(limit_.ask(kRefused, "a", now_).suppressed, 0) << "once";
}

TEST_F(LogLimitTest, AFloodTakesNothingFromOtherClientsAndOtherEvents) {
  EXPECT_EQ(passing(kRefused, "flood", 100'000), 10);
  EXPECT_EQ(passing(kRefused, "other", 10), 10);
  EXPECT_EQ(passing(kJob, "flood", 10), 10);
}

TEST_F(LogLimitTest, WhatWasHeldBackIsReportedAfterAQuietSecond) {
  passing(kRefused, "a", 30);
  EXPECT_TRUE(limit_.take_quiet(now_ + milliseconds(999)).empty());
  const auto reported = limit_.take_quiet(now_ + seconds(1));
  ASSERT_EQ(reported.size(), 1U);
  EXPECT_EQ(reported[0].client, "a");
  EXPECT_STREQ(reported[0].event.name, "refused");
  EXPECT_EQ(reported[0].lines, 20);
  EXPECT_TRUE(limit_.take_quiet(now_ + seconds(9)).empty()) << "once";
}

TEST_F(LogLimitTest, AClientWithANewNameEachTimeGetsNoFurtherThanTwenty) {
  int passed = 0;
  for (int i = 0; i < 50'000; ++i) passed += passing(kRefused, "name " + std::to_string(i), 1);
  EXPECT_EQ(passed, 200);
  EXPECT_EQ(passed + reported_ + unreported(), 50'000) << "forgotten clients' lines are counted too";
}

TEST_F(LogLimitTest, AddsUpWhateverComes) {
  std::int64_t asked = 0;
  std::int64_t passed = 0;
  for (int i = 0; i < 20'000; ++i) {
    now_ += milliseconds(i % 7);
    const int lines = 1 + i % 5;
    passed += passing(i % 2 == 0 ? kRefused : kJob, std::to_string(i * 31 % 1500), lines);
    asked += lines;
    if (i % 100 == 0) {
      for (const auto& one : limit_.take_quiet(now_)) reported_ += one.lines;
    }
  }
  EXPECT_LT(passed, asked);
  EXPECT_EQ(passed + reported_ + unreported(), asked);
}

TEST_F(LogLimitTest, ZeroIsNoLimit) {
  limit_.set_rate(0.0);
  EXPECT_EQ(passing(kRefused, "a", 10'000), 10'000);
  EXPECT_EQ(unreported(), 0);
}

TEST_F(LogLimitTest, LessThanALineASecondIsOneNowAndThen) {
  limit_.set_rate(0.5);
  EXPECT_EQ(passing(kRefused, "a", 100), 1);
  now_ += milliseconds(1999);
  EXPECT_EQ(passing(kRefused, "a", 100), 0);
  now_ += milliseconds(2);
  EXPECT_EQ(passing(kRefused, "a", 100), 1);
}

TEST(Log, HoldsBackWhatIsTooMuchButNoErrors) {
  Log log("text", "info", 1 << 20);
  log.configure(log_levels_of("info", "session=debug,tls=off").value(), 1.0);
  const auto passing = [&](const LogEvent& event) {
    int passed = 0;
    for (int i = 0; i < 100; ++i) passed += log.line(event, "a") ? 1 : 0;
    return passed;
  };
  EXPECT_LT(passing(kRefused), 100);
  EXPECT_EQ(passing({spdlog::level::err, Component::job, "job"}), 100);
  EXPECT_EQ(passing({spdlog::level::err, Component::tls, "certificate_refused"}), 0) << "it is off";
  EXPECT_EQ(passing({spdlog::level::debug, Component::job, "job"}), 0) << "below its level";
  EXPECT_GT(passing({spdlog::level::debug, Component::session, "update"}), 0);
}

LogLevel level(const LogLevels& levels, Component component) {
  return levels[static_cast<std::size_t>(component)];
}

TEST(LogLevels, HoldForAllComponentsButThoseReportedApart) {
  const auto levels = log_levels_of("warn", "session=debug, grpc = off");
  ASSERT_TRUE(levels);
  EXPECT_EQ(level(*levels, Component::session), spdlog::level::debug);
  EXPECT_EQ(level(*levels, Component::grpc), spdlog::level::off);
  EXPECT_EQ(level(*levels, Component::job), spdlog::level::warn);
  EXPECT_EQ(level(log_levels_of("info", "").value(), Component::job), spdlog::level::info);
}

TEST(LogLevels, AFaultNamesWhatIsWrong) {
  const auto fault = [](const std::string& text) { return log_levels_of("info", text).error().message(); };
  EXPECT_EQ(fault("sessions=debug"),
            "log_levels = sessions: must be one of server, config, tls, access, admission, job, session, "
            "http, grpc");
  EXPECT_EQ(fault("job=info,session=shout"),
            "log_levels = session=shout: must be one of debug, info, warn, error, off");
  EXPECT_EQ(fault("debug"), "log_levels = debug: must be COMPONENT=LEVEL");
  EXPECT_EQ(fault("job=info,"), "log_levels: must be COMPONENT=LEVEL");
  EXPECT_EQ(fault("job=info,job=warn"), "log_levels = job: must be given once");
}

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
