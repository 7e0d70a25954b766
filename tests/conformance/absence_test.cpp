// Clients wait for a server that is absent for a while. gRPC connects every five seconds by itself, which is
// too late: this is off here, and each test runs in a process of its own.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <functional>
#include <future>
#include <map>
#include <thread>

#include "marble/batch.h"
#include "marble/client.h"
#include "marble/session.h"
#include "support/absent_server.h"
#include "support/random_problem.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

constexpr std::int64_t kElements = 300, kBeforeAbsence = 20;
constexpr int kKindsOfElements = 7;
// Connections that a client tries before its server is back; with the second number, longer than gRPC repeats
// a call.
constexpr int kSought = 3, kSoughtForLong = 5;

class Absence : public ::testing::Test {
 protected:
  Absence() {
    setenv("GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS", "0", 1);
    for (int i = 0; i < kKindsOfElements; ++i)
      problems_.push_back(random_problem({}, static_cast<std::uint64_t>(i)));
    start("127.0.0.1:0");
    client_.emplace(Client::connect(server_->address()).value());
  }

  // The thread that starts a server must outlive it: the test's own.
  void start(const std::string& listen) {
    server_ = std::make_unique<ServerProcess>(
        MARBLE_SERVER_BINARY, std::vector<std::string>{"--listen", listen, "--batch-window", "8",
                                                       "--state-dir", state_.file("state")});
  }

  void lose_server() {
    server_->send(SIGKILL);
    static_cast<void>(server_->wait());
  }

  // Starts it again once the client has sought it so often.
  void restart(int sought) {
    const std::string address = server_->address();
    {
      const AbsentServer absent(address);
      EXPECT_TRUE(absent.was_sought(sought));
    }
    start(address);
  }

  [[nodiscard]] OwnedProblem& problem(std::int64_t index) {
    return problems_[static_cast<std::size_t>(index) % problems_.size()];
  }

  void take(std::int64_t index, const Expected<RemoteSolution>& answer) {
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_EQ(answer->z, solve_in_process(problem(index).view())->z) << index;
    ++answers_[index];
    ++answered_;
  }

  // Loses the server once some problems have their answers; the call must end with all of them.
  void expect_all(const std::function<Expected<void>()>& call, int sought) {
    auto done = std::async(std::launch::async, call);
    ASSERT_TRUE(eventually([&] { return answered_ >= kBeforeAbsence; }));
    lose_server();
    restart(sought);
    const Expected<void> ended = done.get();
    ASSERT_TRUE(ended.has_value()) << ended.error().message();
    EXPECT_EQ(answers_.size(), static_cast<std::size_t>(kElements));
    for (const auto& [index, count] : answers_) EXPECT_EQ(count, 1) << index;
  }

  [[nodiscard]] ArraySource elements() {
    return [this, next = std::int64_t{0}]() mutable -> std::optional<ArrayElement> {
      if (next == kElements) return std::nullopt;
      return ArrayElement{.problem = problem(next++).view()};
    };
  }

  std::vector<OwnedProblem> problems_;
  TemporaryDirectory state_;
  std::unique_ptr<ServerProcess> server_;
  std::optional<Client> client_;
  std::map<std::int64_t, int> answers_;
  std::atomic<std::int64_t> answered_ = 0;
};

TEST_F(Absence, ABatchContinuesWithItsUnsolvedProblems) {
  std::vector<BatchProblem> batch;
  for (std::int64_t i = 0; i < kElements; ++i) batch.push_back({.tag = i, .problem = problem(i).view()});
  expect_all(
      [&] {
        return client_->solve_batch(
            batch, [&](std::int64_t tag, const Expected<RemoteSolution>& answer) { take(tag, answer); });
      },
      kSought);
}

TEST_F(Absence, ReadingAnArrayContinuesAfterItsLastResult) {
  const auto array = client_->jobs().submit_array(elements());
  ASSERT_TRUE(array.has_value()) << array.error().message();
  expect_all(
      [&] {
        return client_->jobs().array(array->job_id,
                                     [&](const ArrayAnswer& one) { take(one.index, one.answer); });
      },
      kSoughtForLong);
}

TEST_F(Absence, AnArrayIsSubmittedOnceItsServerIsBack) {
  ASSERT_TRUE(client_->jobs().submit_array(elements()).has_value());
  lose_server();
  auto submitted = std::async(std::launch::async, [&] { return client_->jobs().submit_array(elements()); });
  restart(kSoughtForLong);
  const Expected<SubmittedArray> array = submitted.get();
  ASSERT_TRUE(array.has_value()) << array.error().message();
  EXPECT_EQ(array->elements, kElements);
}

TEST_F(Absence, ASessionIsReopened) {
  auto session = client_->open_session(problem(0).view(), {}, {.reopen = true});
  ASSERT_TRUE(session.has_value()) << session.error().message();
  ASSERT_TRUE(session->solve().has_value());
  lose_server();
  auto solved = std::async(std::launch::async, [&] { return session->solve(); });
  restart(kSought);
  const Expected<RemoteSolution> answer = solved.get();
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_TRUE(answer->reopened);
}

}  // namespace
}  // namespace marble::testing
