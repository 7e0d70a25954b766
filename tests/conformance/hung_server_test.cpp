// Sessions whose server hangs: it is stopped by SIGSTOP, and goes on by SIGCONT.
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

#include "marble/client.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

using Seconds = std::chrono::duration<double>;
constexpr Seconds kSoon(0.02), kLong(60.0);

class HungServer : public ::testing::TestWithParam<bool> {
 protected:
  // Returns when all threads have stopped: until then one may still answer.
  static void stop(ServerProcess& server) {
    server.send(SIGSTOP);
    ASSERT_TRUE(eventually([&] {
      const std::string tasks = "/proc/" + std::to_string(server.pid()) + "/task";
      for (const auto& task : std::filesystem::directory_iterator(tasks)) {
        std::ifstream file(task.path() / "stat");
        const std::string text{std::istreambuf_iterator<char>(file), {}};
        if (text.compare(text.rfind(')') + 2, 1, "T") != 0) return false;
      }
      return true;
    }));
  }

  static void expect_no_answer(Session& session, const ProblemUpdate& update, Seconds deadline = kSoon) {
    const auto answer = session.solve(update, {.deadline = deadline});
    ASSERT_FALSE(answer.has_value());
    EXPECT_EQ(answer.error().code, ErrorCode::deadline_exceeded);
    EXPECT_NE(answer.error().message().find("the server did not answer within"), std::string::npos);
  }

  OwnedProblem example_ = public_example().problem;
  const double optimum_ = solve_in_process(example_.view())->objective - example_.c0;
  ServerProcess server_{MARBLE_SERVER_BINARY};
};

TEST_P(HungServer, UpdatesReturnInTimeAndTheNextOneWorksOnceItGoesOn) {
  const Client client = Client::connect(server_.address()).value();
  auto session = client.open_session(example_.view(), {}, {.reopen = GetParam()}).value();
  ASSERT_TRUE(session.solve({}, {.deadline = kLong}).has_value());
  stop(server_);
  for (int k = 1; k <= 3; ++k) {
    EXPECT_TRUE(session.prepare({.g = example_.g}).has_value());
    expect_no_answer(session, {.c0 = k});
    EXPECT_TRUE(session.is_open());
  }
  server_.send(SIGCONT);
  const auto answer = session.solve({}, {.deadline = kLong});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_FALSE(answer->reopened);
  EXPECT_NEAR(answer->objective, optimum_ + 3.0, 1e-6);  // the late answers are discarded, their numbers kept
  if (GetParam()) return;                                // send() is not available
  const std::int64_t number = session.send({.c0 = 7.0}).value();
  const auto event = session.next().value();
  ASSERT_TRUE(event.has_value());
  EXPECT_EQ(event->sequence, number);
  EXPECT_NEAR(std::get<RemoteSolution>(event->outcome).objective, optimum_ + 7.0, 1e-6);
}

TEST_P(HungServer, UpdatesForWhichItHasNoRoomAreSentWhenItGoesOn) {
  constexpr int kVariables = 30'000;  // updates of 240 kB, and a window of 64 kB
  OwnedProblem problem;
  problem.g.assign(kVariables, 1.0);
  problem.Q = {kVariables, kVariables, {0}, {}, std::vector<double>(kVariables, 1.0)};
  for (int i = 0; i < kVariables; ++i) {
    problem.Q.row_indices.push_back(i);
    problem.Q.column_pointers.push_back(i + 1);
  }
  const Client client = Client::connect(server_.address()).value();
  auto session = client.open_session(problem.view(), {}, {.reopen = GetParam()}).value();
  ASSERT_TRUE(session.solve({}, {.deadline = kLong}).has_value());
  stop(server_);
  std::vector<double> g;
  for (int k = 0; k < 4; ++k) {
    g.assign(kVariables, 2.0 + k);
    EXPECT_TRUE(session.prepare({.c0 = k}).has_value());
    expect_no_answer(session, {.g = g});
  }
  server_.send(SIGCONT);
  const auto answer = session.solve({}, {.deadline = kLong});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_NEAR(answer->objective, 3.0 - 12.5 * kVariables, 1e-3);
}

TEST_P(HungServer, ItIsLeftAfterTwentyUpdatesWithoutAnAnswer) {
  ServerProcess other{MARBLE_SERVER_BINARY};
  const Client client = Client::connect(server_.address() + "," + other.address()).value();
  auto session =
      client.open_session(example_.view(), {}, {.reopen = GetParam(), .answer_grace = kSoon}).value();
  ASSERT_TRUE(session.solve({}, {.deadline = kLong}).has_value());
  ServerProcess& busy = Client::connect(server_.address())->info()->sessions > 0 ? server_ : other;
  stop(busy);
  for (int k = 1; k <= 20; ++k) expect_no_answer(session, {.c0 = k});
  EXPECT_FALSE(session.is_open());
  if (!GetParam()) {
    EXPECT_EQ(session.solve().error().message(), "the server left 20 updates in a row without an answer");
    EXPECT_EQ(session.solve().error().code, ErrorCode::unavailable);
  } else {
    ServerProcess& next = &busy == &server_ ? other : server_;
    stop(next);
    EXPECT_EQ(session.solve({}, {.deadline = kSoon}).error().code, ErrorCode::unavailable);
    EXPECT_TRUE(session.prepare({.c0 = 30.0}).has_value()) << "while a set-up is under way";
    next.send(SIGCONT);
    std::optional<RemoteSolution> answer;
    EXPECT_TRUE(eventually([&] {
      auto one = session.solve({}, {.deadline = Seconds(0.2)});
      if (one) answer = std::move(*one);
      return one.has_value();
    }));
    ASSERT_TRUE(answer.has_value());
    EXPECT_TRUE(answer->reopened);
    EXPECT_NEAR(answer->objective, optimum_ + 30.0, 1e-6);
  }
  busy.send(SIGCONT);
}

TEST_P(HungServer, ClosingDoesNotWaitForIt) {
  struct CountedRows final : ProgressSink {
    void report(const Progress&) override { ++rows; }
    int rows = 0;
  };
  const Client client = Client::connect(server_.address()).value();
  auto session = client.open_session(example_.view(), {}, {.progress = true, .reopen = GetParam()}).value();
  ASSERT_TRUE(session.solve({}, {.deadline = kLong}).has_value());
  stop(server_);
  {
    CountedRows rows;  // ends before its update
    EXPECT_FALSE(session.solve({}, {.cold = true, .deadline = kSoon, .progress = &rows}).has_value());
  }
  server_.send(SIGCONT);
  EXPECT_TRUE(session.solve({}, {.deadline = kLong}).has_value());
  stop(server_);
  expect_no_answer(session, {});
  EXPECT_TRUE(session.close().has_value());
  EXPECT_FALSE(session.is_open());
  server_.send(SIGCONT);
  EXPECT_TRUE(eventually([&] { return client.info()->sessions == 0; }));
}

INSTANTIATE_TEST_SUITE_P(Sessions, HungServer, ::testing::Bool(),
                         [](const auto& of) { return of.param ? "Reopened" : "Plain"; });

TEST(AnswerGrace, MustBeInItsRange) {
  const OwnedProblem problem = public_example().problem;
  for (const double grace : {-1.0, 3601.0, std::numeric_limits<double>::quiet_NaN()}) {
    for (const Client& client : {Client::in_process(), Client::connect("127.0.0.1:1").value()}) {
      const auto session = client.open_session(problem.view(), {}, {.answer_grace = Seconds(grace)});
      ASSERT_FALSE(session.has_value());
      EXPECT_EQ(session.error().field, "answer_grace");
    }
  }
}

}  // namespace
}  // namespace marble::testing
