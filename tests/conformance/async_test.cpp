// Solves that go on while the caller does something else, and servers that take turns.
#include <gtest/gtest.h>

#include <atomic>

#include "marble/client.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

/// Goes on until it is stopped: every iteration is one of very many.
Options endless() {
  Options options;
  options.path = Path::paper;
  options.polish = false;
  options.kappa_factor = 0.999999;
  options.max_iterations = 1'000'000;
  return options;
}

class Async : public ::testing::Test {
 protected:
  ServerProcess server_{MARBLE_SERVER_BINARY};
  Client client_ = Client::connect(server_.address()).value();
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
  const Solution here = solve(problem.view()).value();
  std::vector<PendingSolution> pending;
  for (int i = 0; i < 20; ++i) pending.push_back(client_.solve_async(problem.view()).value());
  for (PendingSolution& one : pending) EXPECT_EQ(one.get().value().z, here.z);
}

TEST_F(Async, ProgressIsToldUntilItIsCancelled) {
  class Counter : public ProgressSink {
   public:
    void report(const Progress&) override { ++rows; }
    std::atomic<int> rows = 0;
  } counter;
  auto pending = client_.solve_async(examples::gates().view(), endless(), {.progress = &counter}).value();
  ASSERT_TRUE(eventually([&] { return counter.rows > 10; }));
  EXPECT_FALSE(pending.is_ready());
  pending.cancel();
  EXPECT_EQ(pending.get().error().code, ErrorCode::cancelled);
}

TEST_F(Async, AStopTokenGivesItUpToo) {
  std::stop_source stop;
  auto pending = client_.solve_async(examples::gates().view(), endless(), {.stop = stop.get_token()}).value();
  stop.request_stop();
  EXPECT_EQ(pending.get().error().code, ErrorCode::cancelled);
}

TEST_F(Async, AHandleThatIsDroppedFreesTheWorker) {
  { const auto dropped = client_.solve_async(examples::gates().view(), endless()).value(); }
  EXPECT_TRUE(eventually([&] { return client_.info().value().running == 0; }));
}

TEST_F(Async, ABadProblemIsToldAtTheServersWordOrBefore) {
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

class Several : public ::testing::Test {
 protected:
  static std::int64_t answered(const ServerProcess& server) {
    return Client::connect(server.address()).value().info().value().answered;
  }
};

TEST_F(Several, ServersTakeTurnsAndADrainedOneGetsNothing) {
  ServerProcess first(MARBLE_SERVER_BINARY), second(MARBLE_SERVER_BINARY);
  const Client client = Client::connect(first.address() + "," + second.address()).value();
  const OwnedProblem problem = examples::rocket();
  ASSERT_TRUE(eventually([&] {
    EXPECT_TRUE(client.solve(problem.view()).has_value());
    return answered(first) > 0 && answered(second) > 0;
  }));
  first.terminate();
  EXPECT_EQ(first.wait(), 0);
  const std::int64_t before = answered(second);
  for (int i = 0; i < 10; ++i) {
    const auto answer = client.solve(problem.view());
    EXPECT_TRUE(answer.has_value()) << answer.error().message();
  }
  EXPECT_EQ(answered(second), before + 10);
}

TEST_F(Several, AKilledServersSolveIsRepeatedElsewhere) {
  auto first = std::make_unique<ServerProcess>(MARBLE_SERVER_BINARY);
  const ServerProcess second(MARBLE_SERVER_BINARY);
  const Client client = Client::connect(first->address() + "," + second.address()).value();
  const OwnedProblem problem = examples::hopper();
  std::vector<PendingSolution> pending;
  for (int i = 0; i < 12; ++i) pending.push_back(client.solve_async(problem.view()).value());
  const Client there = Client::connect(first->address()).value();
  ASSERT_TRUE(eventually([&] { return there.info().value().running > 0; }));
  first->send(SIGKILL);
  for (PendingSolution& one : pending) {
    const auto answer = one.get();
    EXPECT_TRUE(answer.has_value()) << answer.error().message();
  }
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(client.solve(problem.view()).has_value());
}

TEST_F(Several, AddressesThatAreNoneAreRefusedByName) {
  EXPECT_EQ(Client::connect("127.0.0.1:1,nowhere").error().value, "\"nowhere\"");
  EXPECT_EQ(Client::connect("127.0.0.1:1,unix:/tmp/x").error().field, "address");
  EXPECT_EQ(Client::connect("127.0.0.1:1,").error().field, "address");
  EXPECT_EQ(Client::connect("127.0.0.1:1,[::1]:2").error().value, "\"[::1]:2\"");
  EXPECT_EQ(Client::connect("127.0.0.1:1,no-such-host.invalid:2").error().code, ErrorCode::unavailable);
}

}  // namespace
}  // namespace marble::testing
