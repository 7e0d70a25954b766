// Sessions whose server hangs: it is stopped by SIGSTOP, and goes on by SIGCONT.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <optional>
#include <vector>

#include "marble/client.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

using Seconds = std::chrono::duration<double>;
constexpr Seconds kSoon(0.02), kLong(60.0);

// Returns when all threads have stopped: until then one may still answer.
void stop(ServerProcess& server) {
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

constexpr int kVariables = 30'000;  // updates of 240 kB, and a window of 64 kB

OwnedProblem large_problem() {
  OwnedProblem problem;
  problem.g.assign(kVariables, 1.0);
  problem.Q = {kVariables, kVariables, {0}, {}, std::vector<double>(kVariables, 1.0)};
  for (int i = 0; i < kVariables; ++i) {
    problem.Q.row_indices.push_back(i);
    problem.Q.column_pointers.push_back(i + 1);
  }
  return problem;
}

class HungServer : public ::testing::TestWithParam<bool> {
 protected:
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
  const OwnedProblem problem = large_problem();
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

TEST_P(HungServer, FirstPartsForWhichItHasNoRoomAreRefused) {
  const OwnedProblem problem = large_problem();
  const Client client = Client::connect(server_.address()).value();
  auto session =
      client.open_session(problem.view(), {}, {.reopen = GetParam(), .answer_grace = kSoon}).value();
  ASSERT_TRUE(session.solve({}, {.deadline = kLong}).has_value());
  stop(server_);
  int taken = 0;
  const auto prepare = [&] {
    const std::vector<double> g(kVariables, 2.0 + taken);
    return session.prepare({.g = g});
  };
  Expected<std::int64_t> sent = prepare();
  for (; sent && taken < 1000; sent = prepare()) ++taken;
  ASSERT_FALSE(sent.has_value());
  EXPECT_EQ(sent.error().code, ErrorCode::unavailable);
  EXPECT_EQ(sent.error().message(), "16 messages wait for the server to receive them");
  EXPECT_GE(taken, 16);
  EXPECT_TRUE(session.is_open());
  server_.send(SIGCONT);
  const auto answer = session.solve({}, {.deadline = kLong});
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_FALSE(answer->reopened);
  EXPECT_NEAR(answer->objective, -0.5 * (1.0 + taken) * (1.0 + taken) * kVariables, 1e-3);
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

// Updates that the draining server refuses, while the next one hangs.
TEST(LateReopening, HasTheNumbersPreparedMeanwhile) {
  const std::vector<std::string> flags = {"--drain-grace-s", "3600"};
  ServerProcess one{MARBLE_SERVER_BINARY, flags}, other{MARBLE_SERVER_BINARY, flags};
  OwnedProblem problem = public_example().problem;
  const Client client = Client::connect(one.address() + "," + other.address()).value();
  auto session = client.open_session(problem.view(), {}, {.reopen = true}).value();
  ASSERT_TRUE(session.solve({}, {.deadline = kLong}).has_value());
  const bool at_one = Client::connect(one.address())->info()->sessions > 0;
  ServerProcess &left = at_one ? one : other, &next = at_one ? other : one;
  stop(next);
  left.terminate();
  const auto is_late = [&] {
    const auto answer = session.solve({}, {.deadline = Seconds(0.2)});
    return !answer && answer.error().code == ErrorCode::unavailable;
  };
  ASSERT_TRUE(eventually(is_late));
  for (double& cost : problem.g) cost -= 1.0;
  EXPECT_TRUE(session.prepare({.g = problem.g}).has_value());
  EXPECT_TRUE(is_late());
  next.send(SIGCONT);
  const auto answer = session.solve();
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_TRUE(answer->reopened);
  EXPECT_NEAR(answer->objective, solve_in_process(problem.view())->objective, 1e-6);
}

// Of three servers one dies and two hang, of which one goes on. Updates with deadlines have set sessions up
// at any.
TEST(LateReopening, LeavesAServerThatHangsWithoutADeadlineToo) {
  std::optional<ServerProcess> servers[3];
  std::string addresses;
  for (auto& server : servers)
    addresses += (addresses.empty() ? "" : ",") + server.emplace(MARBLE_SERVER_BINARY).address();
  const OwnedProblem problem = public_example().problem;
  const ConnectOptions patient = {
      .keepalive = {.silence = Seconds(3600.0)}};  // which notices no server that hangs
  const Client client = Client::connect(addresses, patient).value();
  std::vector<Session> sessions;
  const auto has_some = [](const auto& server) {
    return Client::connect(server->address())->info()->sessions > 2;
  };
  ASSERT_TRUE(eventually([&] {
    sessions.push_back(
        client.open_session(problem.view(), {}, {.reopen = true, .reopen_wait = kLong}).value());
    return std::all_of(std::begin(servers), std::end(servers), has_some);
  }));
  servers[0].reset();
  stop(*servers[1]);
  stop(*servers[2]);
  std::vector<Session*> lost;
  for (Session& session : sessions) {
    const auto late = session.solve({}, {.deadline = kSoon});
    ASSERT_FALSE(late.has_value());
    if (late.error().code == ErrorCode::unavailable) lost.push_back(&session);
  }
  EXPECT_GE(lost.size(), 3U);
  servers[1]->send(SIGCONT);
  for (Session* session : lost) {
    const auto answer = session->solve();
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_TRUE(answer->reopened);
  }
  servers[2]->send(SIGCONT);
}

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
