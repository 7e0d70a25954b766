// Limits: a full queue, deadlines in the queue and mid-solve, messages beyond their size.
#include <functional>
#include <limits>
#include <optional>

#include "service_test.h"

namespace marble::testing {
namespace {

class Limits : public ServiceTest {};

// Long enough for `begins` to see the call begin, short enough to wait for: twice as long as one that was
// not.
template <class Begins>
void with_a_deadline(const Begins& begins) {
  for (std::chrono::milliseconds deadline{500}; deadline < std::chrono::minutes(2); deadline *= 2) {
    if (begins(deadline)) return;
  }
  FAIL() << "never began within its deadline";
}

TEST_F(Limits, AFullQueueRefusesAndReportsWhenToRetry) {
  start({"--workers", "1", "--queue-jobs", "1"});
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  Stream waiting(solver(), long_request());
  const auto accepted = waiting.next();
  ASSERT_TRUE(accepted && accepted->has_accepted());
  EXPECT_EQ(accepted->accepted().queue_position(), 0);
  v1::SolveResponse response;
  const grpc::Status refused = solve(example_request(), &response);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  const auto retry = retry_info(refused);
  ASSERT_TRUE(retry.has_value());
  EXPECT_GT(retry->retry_delay().seconds() + retry->retry_delay().nanos(), 0);
  running.cancel();
  ASSERT_TRUE(waiting.read_until(Event::kStarted)) << "room for the next";
  EXPECT_EQ(counters().refused_total(), 1);
}

// The fault of its problem shows how far it was read.
TEST_F(Limits, ARequestThatCannotEndInTimeIsRefusedBeforeItsProblemIsRead) {
  using std::chrono_literals::operator""ms;
  start({"--workers", "1"});
  v1::SolveRequest bad = example_request();
  const auto unary = [&](std::optional<std::chrono::milliseconds> deadline) {
    v1::SolveResponse response;
    return solve(bad, &response, deadline);
  };
  const auto streamed = [&](std::optional<std::chrono::milliseconds> deadline) {
    Stream stream(solver(), bad, deadline);
    EXPECT_TRUE(stream.drain().empty());
    return stream.finish();
  };
  using Way = std::function<grpc::Status(std::optional<std::chrono::milliseconds>)>;
  for (const Way& way : {Way(unary), Way(streamed)}) {
    bad.mutable_problem()->set_gradient(0, std::numeric_limits<double>::quiet_NaN());
    bad.set_request_id("hasty");
    Stream running(solver(), long_request());
    ASSERT_TRUE(running.read_until(Event::kStarted));
    EXPECT_EQ(way(std::nullopt).error_code(), grpc::StatusCode::INVALID_ARGUMENT) << "it has time";
    grpc::Status refused;
    ASSERT_TRUE(eventually([&] {  // once the other job has run for as long as this one has time
      refused = way(500ms);
      return refused.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED;
    }));
    EXPECT_NE(refused.error_message().find("deadline"), std::string::npos) << refused.error_message();
    EXPECT_TRUE(retry_info(refused).has_value());
    bad.set_priority(static_cast<v1::Priority>(7));  // what is read is checked
    EXPECT_EQ(way(500ms).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    bad.clear_priority();
    bad.mutable_options()->set_max_iterations(-1);
    EXPECT_EQ(way(500ms).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    bad.clear_options();
    running.cancel();
    ASSERT_TRUE(eventually_idle());
    EXPECT_EQ(way(10'000ms).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  }
}

TEST_F(Limits, ARefusedStreamGetsTheSameStatusAndNoEvent) {
  start({"--workers", "1", "--queue-jobs", "0"});
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  Stream refused(solver(), example_request());
  EXPECT_FALSE(refused.next().has_value());
  const grpc::Status status = refused.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(retry_info(status).has_value());
}

TEST_F(Limits, JobsRunInTheOrderTheyCame) {
  start({"--workers", "1"});
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  Stream second(solver(), long_request());
  ASSERT_TRUE(second.read_until(Event::kAccepted));
  Stream third(solver(), long_request());
  const auto accepted = third.next();
  ASSERT_TRUE(accepted && accepted->has_accepted());
  EXPECT_EQ(accepted->accepted().queue_position(), 1);
  running.cancel();
  EXPECT_TRUE(second.read_until(Event::kStarted));
  EXPECT_EQ(counters().queued(), 1);
}

TEST_F(Limits, TheQueueIsBoundedInBytes) {
  const std::int64_t one_job = static_cast<std::int64_t>(long_request().ByteSizeLong());
  start({"--workers", "1", "--queue-bytes", std::to_string(one_job + 100'000)});
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  v1::SolveResponse response;
  const grpc::Status refused = solve(long_request(), &response);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(refused.error_message().find("bytes"), std::string::npos) << refused.error_message();
  running.cancel();
  ASSERT_TRUE(eventually_idle());
  EXPECT_TRUE(solve(long_request(1), &response).ok()) << "the bytes of finished jobs are free again";
}

TEST_F(Limits, AJobWhoseDeadlinePassesInTheQueueNeverStarts) {
  start({"--workers", "1", "--log-format", "json"});
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  v1::SolveRequest late = example_request();
  with_a_deadline([&](std::chrono::milliseconds deadline) {
    late.set_request_id("late" + std::to_string(deadline.count()));
    Stream waiting(solver(), late, deadline);
    if (!waiting.read_until(Event::kAccepted)) return false;
    EXPECT_FALSE(waiting.next().has_value()) << "nothing follows, not even started";
    EXPECT_EQ(waiting.finish().error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
    return true;
  });
  const std::string request = "\"request\":\"" + late.request_id() + "\"";
  EXPECT_TRUE(eventually([&] { return counters().queued() == 0; }))
      << "its place is free while the other still runs";
  EXPECT_EQ(counters().running(), 1);
  ASSERT_TRUE(eventually([&] { return !server().log_lines({request}).empty(); }));
  const auto lines = server().log_lines({request});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("\"factorizations\":0"), std::string::npos) << lines[0];
}

TEST_F(Limits, ADeadlineStopsARunningSolveAndFreesItsWorker) {
  start({"--workers", "1"});
  std::int64_t before = 0;
  with_a_deadline([&](std::chrono::milliseconds deadline) {
    EXPECT_TRUE(eventually_idle());
    before = counters().cancelled_total();
    Stream stream(solver(), long_request(), deadline);
    if (!stream.read_until(Event::kStarted)) return false;
    EXPECT_EQ(stream.finish().error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
    return true;
  });
  EXPECT_TRUE(eventually_idle());
  EXPECT_EQ(counters().cancelled_total(), before + 1);
  EXPECT_TRUE(lives());
}

TEST_F(Limits, ADeadlineStopsAUnarySolveToo) {
  start({"--workers", "1"});
  v1::SolveResponse response;
  EXPECT_EQ(solve(long_request(), &response, std::chrono::seconds(1)).error_code(),
            grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_TRUE(eventually_idle());
  EXPECT_TRUE(lives());
}

TEST_F(Limits, AMessageBeyondTheLimitIsRefused) {
  start({"--message-bytes", "100000"});
  v1::SolveResponse response;
  const grpc::Status status = solve(long_request(), &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(lives());
}

}  // namespace
}  // namespace marble::testing
