// Solves that go on while the caller does something else.
#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <memory>
#include <optional>
#include <thread>

#include "marble/client.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "problems.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

class Counter : public ProgressSink {
 public:
  void report(const Progress&) override { ++rows; }
  std::atomic<int> rows = 0;
};

class Async : public ::testing::Test {
 protected:
  ServerProcess server_{MARBLE_SERVER_BINARY};
  Client client_ = Client::connect(server_.address()).value();
  // Goes on until it is stopped.
  const v1::SolveRequest long_ = long_request();
  const ProblemView endless_ = view_of(long_.problem());
  const Options tiny_steps_ = options_of(long_.options()).value();
};

TEST_F(Async, AnAnswerThatIsWaitedForLaterIsTheSame) {
  const OwnedProblem problem = examples::rocket();
  auto pending = client_.solve_async(problem.view()).value();
  const RemoteSolution here = client_.solve(problem.view()).value();
  const auto there = pending.get();
  ASSERT_TRUE(there.has_value()) << there.error().message();
  EXPECT_EQ(there->z, here.z);
  EXPECT_EQ(there->status, Status::solved);
  EXPECT_FALSE(there->job_id.empty());
  EXPECT_EQ(pending.get().error().code, ErrorCode::failed_precondition) << "it was taken";
}

TEST_F(Async, ManyGoOnAtOnce) {
  const OwnedProblem problem = examples::rocket();
  const Solution here = solve_in_process(problem.view()).value();
  std::vector<PendingSolution> pending;
  for (int i = 0; i < 20; ++i) pending.push_back(client_.solve_async(problem.view()).value());
  for (PendingSolution& one : pending) EXPECT_EQ(one.get().value().z, here.z);
}

TEST_F(Async, ProgressIsReportedUntilItIsCancelled) {
  Counter counter;
  auto pending = client_.solve_async(endless_, tiny_steps_, {.progress = &counter}).value();
  ASSERT_TRUE(eventually([&] { return counter.rows > 10; }));
  EXPECT_FALSE(pending.is_ready());
  pending.cancel();
  EXPECT_EQ(pending.get().error().code, ErrorCode::cancelled);
  const int reported = counter.rows;
  EXPECT_TRUE(eventually([&] { return client_.info().value().running == 0; }));
  EXPECT_EQ(counter.rows, reported) << "nothing is reported after the end";
}

TEST_F(Async, WhatIsReportedIsWhatACallThatWaitsIsReported) {
  class Rows : public ProgressSink {
   public:
    void report(const Progress& row) override { objectives.push_back(row.objective); }
    std::vector<double> objectives;
  } here, there;
  std::string accepted;
  int started = 0;
  const CallControls call = {.accepted = [&](const std::string& id, int, double) { accepted = id; },
                             .started = [&](double) { ++started; }};
  const OwnedProblem problem = examples::rocket();
  const auto waited = client_.solve(problem.view(), {}, {.progress = &here}).value();
  auto pending = client_.solve_async(problem.view(), {}, {.progress = &there}, call).value();
  const auto answer = pending.get().value();
  EXPECT_EQ(answer.z, waited.z);
  EXPECT_EQ(answer.job_id, accepted);
  EXPECT_EQ(started, 1);
  EXPECT_EQ(there.objectives.size() + static_cast<std::size_t>(answer.progress_skipped),
            here.objectives.size() + static_cast<std::size_t>(waited.progress_skipped));
}

TEST_F(Async, AWaitMayHaveALimit) {
  const auto slow = client_.solve_async(endless_, tiny_steps_).value();
  EXPECT_FALSE(slow.wait_for(std::chrono::milliseconds(20)));
  EXPECT_FALSE(slow.wait_for(std::chrono::seconds(-1)));
  const OwnedProblem problem = examples::rocket();
  auto quick = client_.solve_async(problem.view()).value();
  EXPECT_TRUE(quick.wait_for(std::chrono::duration<double>(std::numeric_limits<double>::infinity())));
  EXPECT_TRUE(quick.is_ready());
  EXPECT_TRUE(quick.get().has_value());
}

TEST_F(Async, AStopTokenGivesItUpToo) {
  std::stop_source stop;
  auto pending = client_.solve_async(endless_, tiny_steps_, {.stop = stop.get_token()}).value();
  stop.request_stop();
  EXPECT_EQ(pending.get().error().code, ErrorCode::cancelled);
  auto stillborn = client_.solve_async(endless_, tiny_steps_, {.stop = stop.get_token()}).value();
  EXPECT_EQ(stillborn.get().error().code, ErrorCode::cancelled);
}

TEST_F(Async, ADeadlineEndsIt) {
  auto pending =
      client_.solve_async(endless_, tiny_steps_, {}, {.deadline = std::chrono::milliseconds(50)}).value();
  EXPECT_EQ(pending.get().error().code, ErrorCode::deadline_exceeded);
}

TEST_F(Async, TheConnectionsDeadlineIsThatOfCallsWithoutOne) {
  const Client hurried =
      Client::connect(server_.address(), {.deadline = std::chrono::milliseconds(50)}).value();
  EXPECT_EQ(hurried.solve(endless_, tiny_steps_).error().code, ErrorCode::deadline_exceeded);
  EXPECT_EQ(hurried.solve_async(endless_, tiny_steps_)->get().error().code, ErrorCode::deadline_exceeded);
  auto patient = hurried.solve_async(endless_, tiny_steps_, {}, {.deadline = std::chrono::hours(1)}).value();
  EXPECT_FALSE(patient.wait_for(std::chrono::milliseconds(200)));
  const std::string job = client_.jobs().submit(endless_, tiny_steps_)->job_id;
  EXPECT_EQ(hurried.jobs().result(job, {.wait = true}).error().code, ErrorCode::deadline_exceeded);
  EXPECT_TRUE(client_.jobs().cancel(job).has_value());
}

TEST_F(Async, AHandleThatIsDroppedFreesTheWorkerAndReportsNothingMore) {
  auto counter = std::make_unique<Counter>();
  {
    const auto dropped = client_.solve_async(endless_, tiny_steps_, {.progress = counter.get()}).value();
    ASSERT_TRUE(eventually([&] { return counter->rows > 0; }));
  }
  counter.reset();  // a late report would be seen by the address sanitizer
  EXPECT_TRUE(eventually([&] { return client_.info().value().running == 0; }));
}

TEST_F(Async, AHandleThatIsAssignedToGivesUpWhatItHad) {
  auto pending = client_.solve_async(endless_, tiny_steps_).value();
  ASSERT_TRUE(eventually([&] { return client_.info().value().running == 1; }));
  const OwnedProblem problem = examples::rocket();
  pending = client_.solve_async(problem.view()).value();
  EXPECT_TRUE(pending.get().has_value());
  EXPECT_TRUE(eventually([&] { return client_.info().value().running == 0; }));
}

TEST_F(Async, ItMayBeCancelledByACallbackOfItsOwnAndByAnotherThread) {
  std::optional<PendingSolution> pending;
  std::atomic<bool> known = false;
  class Canceller : public ProgressSink {
   public:
    Canceller(std::optional<PendingSolution>& handle, std::atomic<bool>& ready)
        : handle_(handle), ready_(ready) {}
    void report(const Progress&) override {
      if (ready_) handle_->cancel();
    }

   private:
    std::optional<PendingSolution>& handle_;
    std::atomic<bool>& ready_;
  } canceller(pending, known);
  pending = client_.solve_async(endless_, tiny_steps_, {.progress = &canceller}).value();
  known = true;
  EXPECT_EQ(pending->get().error().code, ErrorCode::cancelled);
  auto other = client_.solve_async(endless_, tiny_steps_).value();
  const std::jthread thread([&] { other.cancel(); });
  EXPECT_EQ(other.get().error().code, ErrorCode::cancelled);
}

TEST_F(Async, ItOutlivesItsClientAndReportsOfAServerThatDies) {
  auto client = std::make_unique<Client>(Client::connect(server_.address()).value());
  Counter counter;
  auto pending = client->solve_async(endless_, tiny_steps_, {.progress = &counter}).value();
  ASSERT_TRUE(eventually([&] { return counter.rows > 0; }));
  client.reset();
  EXPECT_FALSE(pending.is_ready());
  server_.send(SIGKILL);
  EXPECT_EQ(pending.get().error().code, ErrorCode::unavailable);
}

TEST_F(Async, ABadProblemIsReportedAtTheServersWordOrBefore) {
  OwnedProblem problem = examples::rocket();
  problem.b[3] = std::numeric_limits<double>::quiet_NaN();
  auto pending = client_.solve_async(problem.view());
  ASSERT_TRUE(pending.has_value());
  const auto answer = pending->get();
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().field, "b");
  EXPECT_EQ(answer.error().index, 3);
  EXPECT_EQ(client_.solve_async(examples::rocket().view(), {}, {}, {.request_id = "a\nb"}).error().field,
            "request_id");
}

}  // namespace
}  // namespace marble::testing
