// Submissions to a server whose queue is full: which ones wait, how long, and what their caller learns.
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <limits>

#include "marble/client.h"
#include "marble/convert.h"
#include "problems.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

using std::chrono::duration;

// A server with one worker, which is busy, and a queue of one place, which is taken.
class QueueWaitTest : public ::testing::Test {
 protected:
  void SetUp() override {
    blockers_.push_back(submit_long());
    ASSERT_TRUE(eventually([&] { return client_.info()->running == 1; }));
    blockers_.push_back(submit_long());
  }

  std::string submit_long() {
    const v1::SolveRequest request = long_request();
    const auto job = jobs_.submit(view_of(request.problem()), options_of(request.options()).value(), {},
                                  {.priority = Priority::batch});
    EXPECT_TRUE(job.has_value()) << (job ? "" : job.error().message());
    return job ? job->job_id : "";
  }
  void free_the_server() {
    for (auto id = blockers_.rbegin(); id != blockers_.rend(); ++id)
      EXPECT_TRUE(jobs_.cancel(*id).has_value());
  }
  [[nodiscard]] bool refuses(std::int64_t count) {
    return eventually([&] { return client_.info()->refused >= count; });
  }
  // Counts its calls and keeps the newest reason.
  std::function<void(const Error&)> listener() {
    return [this](const Error& reason) {
      ++reports_;
      field_ = reason.field;
    };
  }
  CallControls call() { return {.priority = Priority::batch, .waiting = listener()}; }

  OwnedProblem example_ = public_example().problem;
  ServerProcess server_{MARBLE_SERVER_BINARY, {"--workers", "1", "--queue-jobs", "1"}};
  Client client_ = Client::connect(server_.address()).value();
  Jobs jobs_ = client_.jobs();
  std::vector<std::string> blockers_;
  std::atomic<int> reports_ = 0;
  std::string field_;
};

TEST_F(QueueWaitTest, ASubmissionWaitsForSpaceAndReportsItOnce) {
  CallControls controls = call();
  controls.deadline = std::chrono::minutes(5);
  auto submitted =
      std::async(std::launch::async, [&] { return jobs_.submit(example_.view(), {}, {}, controls); });
  EXPECT_TRUE(refuses(2));
  free_the_server();
  const auto job = submitted.get();
  ASSERT_TRUE(job.has_value()) << job.error().message();
  EXPECT_TRUE(is_solved(jobs_.result(job->job_id, {.wait = true})->status));
  EXPECT_EQ(reports_, 1);
  EXPECT_EQ(field_, "queue_jobs");
}

TEST_F(QueueWaitTest, AnArrayWaitsAndItsSourceIsReadOnce) {
  int read = 0;
  const ArraySource source = [&]() -> std::optional<ArrayElement> {
    if (read == 5) return std::nullopt;
    ++read;
    return ArrayElement{.problem = example_.view()};
  };
  const ArrayControls controls{
      .priority = Priority::batch, .queue_wait = std::chrono::minutes(5), .waiting = listener()};
  auto submitted = std::async(std::launch::async, [&] { return jobs_.submit_array(source, controls); });
  EXPECT_TRUE(refuses(2));
  free_the_server();
  const auto array = submitted.get();
  ASSERT_TRUE(array.has_value()) << array.error().message();
  EXPECT_EQ(array->elements, 5);
  EXPECT_EQ(read, 5);
  EXPECT_EQ(reports_, 1);
  int solved = 0;
  const auto done = jobs_.array(array->job_id, [&](const ArrayAnswer& answer) {
    solved += answer.answer && is_solved(answer.answer->status) ? 1 : 0;
  });
  EXPECT_TRUE(done.has_value());
  EXPECT_EQ(solved, 5);
}

TEST_F(QueueWaitTest, TheWaitEndsWithTheRefusal) {
  CallControls controls = call();
  controls.queue_wait = duration<double>(0.1);
  const auto refused = jobs_.submit(example_.view(), {}, {}, controls);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::resource_exhausted);
  EXPECT_EQ(refused.error().field, "queue_jobs");
  EXPECT_EQ(reports_, 1);
  EXPECT_GE(client_.info()->refused, 2);
}

TEST_F(QueueWaitTest, WithoutAWaitTheFirstRefusalIsTheResult) {
  CallControls controls = call();
  controls.queue_wait = duration<double>(0.0);
  EXPECT_EQ(jobs_.submit(example_.view(), {}, {}, controls).error().code, ErrorCode::resource_exhausted);
  const auto element = [given = false, this]() mutable -> std::optional<ArrayElement> {
    if (std::exchange(given, true)) return std::nullopt;
    return ArrayElement{.problem = example_.view()};
  };
  const auto array = jobs_.submit_array(
      element, {.priority = Priority::batch, .queue_wait = duration<double>(0.0), .waiting = listener()});
  EXPECT_EQ(array.error().code, ErrorCode::resource_exhausted);
  EXPECT_EQ(client_.info()->refused, 2);
  EXPECT_EQ(reports_, 0);
  for (const double wait : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    controls.queue_wait = duration<double>(wait);
    EXPECT_EQ(jobs_.submit(example_.view(), {}, {}, controls).error().field, "queue_wait");
  }
}

TEST_F(QueueWaitTest, ADeadlineThatWouldPassFirstEndsIt) {
  CallControls controls = call();
  controls.deadline = duration<double>(0.2);
  const auto refused = jobs_.submit(example_.view(), {}, {}, controls);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::resource_exhausted);
}

TEST_F(QueueWaitTest, AStopTokenEndsIt) {
  std::stop_source source;
  CallControls controls = call();
  controls.queue_wait = std::chrono::minutes(5);
  controls.waiting = [&](const Error&) { source.request_stop(); };
  const auto stopped = jobs_.submit(example_.view(), {}, {.stop = source.get_token()}, controls);
  ASSERT_FALSE(stopped.has_value());
  EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
  EXPECT_EQ(stopped.error().bound, "cancelled by the caller");
}

TEST_F(QueueWaitTest, ABatchWaitsAtTheServerWithoutARefusal) {
  const std::vector<BatchProblem> batch(10, BatchProblem{.problem = example_.view()});
  std::atomic<int> solved = 0;
  const BatchSink sink = [&](std::int64_t, const Expected<RemoteSolution>& answer) {
    solved += answer && is_solved(answer->status) ? 1 : 0;
  };
  auto done = std::async(std::launch::async, [&] {
    return client_.solve_batch(batch, sink, {.priority = Priority::batch, .waiting = listener()});
  });
  free_the_server();
  EXPECT_TRUE(done.get().has_value());
  EXPECT_EQ(solved, 10);
  EXPECT_EQ(reports_, 0);
}

TEST(QueueWait, ARequestThatNeverFitsIsRefusedAtOnce) {
  const ServerProcess server{MARBLE_SERVER_BINARY, {"--queue-bytes", "4096"}};
  const auto client = Client::connect(server.address());
  const v1::SolveRequest large = long_request();
  bool waited = false;
  CallControls controls;
  controls.queue_wait = std::chrono::minutes(5);
  controls.waiting = [&](const Error&) { waited = true; };
  const auto refused = client->jobs().submit(view_of(large.problem()), {}, {}, controls);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().field, "queue_bytes");
  EXPECT_FALSE(waited);
}

TEST(QueueWait, TheClientsOwnShareIsWaitedForToo) {
  const ServerProcess server{MARBLE_SERVER_BINARY, {"--workers", "1", "--client-queued", "1"}};
  const auto client = Client::connect(server.address());
  const Jobs jobs = client->jobs();
  const v1::SolveRequest request = long_request();
  const auto submit_long = [&] {
    return jobs.submit(view_of(request.problem()), options_of(request.options()).value())->job_id;
  };
  const std::string running = submit_long();
  ASSERT_TRUE(eventually([&] { return client->info()->running == 1; }));
  const std::string waiting = submit_long();
  std::string field;
  CallControls controls;
  controls.queue_wait = std::chrono::minutes(5);
  controls.waiting = [&](const Error& reason) {
    field = reason.field;
    EXPECT_TRUE(jobs.cancel(waiting).has_value());
    EXPECT_TRUE(jobs.cancel(running).has_value());
  };
  const OwnedProblem example = public_example().problem;
  const auto job = jobs.submit(example.view(), {}, {}, controls);
  ASSERT_TRUE(job.has_value()) << job.error().message();
  EXPECT_EQ(field, "client_queued");
}

}  // namespace
}  // namespace marble::testing
