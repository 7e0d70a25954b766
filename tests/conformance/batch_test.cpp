#include "marble/batch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <map>
#include <semaphore>

#include "marble/client.h"
#include "marble/convert.h"
#include "problems.h"
#include "support/random_problem.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

// Many problems on one stream.
constexpr int kMany = 300;  // more than the server's window of 64

class BatchTest : public ::testing::Test {
 protected:
  ServerProcess server_{MARBLE_SERVER_BINARY};
  Expected<Client> client_ = Client::connect(server_.address());
};

std::vector<OwnedProblem> many_problems() {
  std::vector<OwnedProblem> problems;
  for (int i = 0; i < kMany; ++i) problems.push_back(random_problem({}, static_cast<std::uint64_t>(i)));
  return problems;
}

TEST_F(BatchTest, EveryProblemIsAnsweredOnceAndRight) {
  const std::vector<OwnedProblem> problems = many_problems();
  std::vector<BatchProblem> batch;
  for (int i = 0; i < kMany; ++i) batch.push_back({.tag = 1000 + i, .problem = problems[i].view()});
  std::map<std::int64_t, int> answers;
  const auto done = client_->solve_batch(batch, [&](std::int64_t tag, Expected<RemoteSolution> answer) {
    ++answers[tag];
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_EQ(answer->z, solve_in_process(problems[tag - 1000].view())->z) << tag;
  });
  ASSERT_TRUE(done.has_value()) << done.error().message();
  EXPECT_EQ(answers.size(), static_cast<std::size_t>(kMany));
  for (const auto& [tag, count] : answers) EXPECT_EQ(count, 1) << tag;
}

TEST_F(BatchTest, ABadProblemIsAnErrorOfItsOwn) {
  OwnedProblem good = random_problem({}, 1);
  OwnedProblem bad = good;
  bad.g[2] = std::numeric_limits<double>::quiet_NaN();
  const std::vector<BatchProblem> batch = {{.tag = 1, .problem = bad.view()},
                                           {.tag = 2, .problem = good.view(), .request_id = "\n"},
                                           {.tag = 3, .problem = good.view()}};
  std::map<std::int64_t, std::string> fields;
  const auto done = client_->solve_batch(batch, [&](std::int64_t tag, Expected<RemoteSolution> answer) {
    fields[tag] = answer ? "solved" : answer.error().field;
  });
  EXPECT_TRUE(done.has_value());
  EXPECT_EQ(fields, (std::map<std::int64_t, std::string>{{1, "g"}, {2, "request_id"}, {3, "solved"}}));
}

TEST_F(BatchTest, AStopTokenGivesAllOfItUpAndEveryTagIsReported) {
  const v1::SolveRequest request = long_request();
  const Options options = options_of(request.options()).value();
  std::stop_source source;
  const std::vector<BatchProblem> batch = {
      {.tag = 1, .problem = view_of(request.problem()), .options = options},
      {.tag = 2, .problem = view_of(request.problem()), .options = options}};
  std::size_t given = 0;
  const BatchSource give = [&]() -> std::optional<BatchProblem> {
    if (given == batch.size()) {
      EXPECT_TRUE(eventually([&] { return client_->info()->running > 0; }));
      source.request_stop();
      return std::nullopt;
    }
    return batch[given++];
  };
  std::map<std::int64_t, ErrorCode> codes;
  const auto done = client_->solve_batch(give,
                                         [&](std::int64_t tag, Expected<RemoteSolution> answer) {
                                           ASSERT_FALSE(answer.has_value());
                                           codes[tag] = answer.error().code;
                                         },
                                         {.stop = source.get_token()});
  ASSERT_FALSE(done.has_value());
  EXPECT_EQ(done.error().code, ErrorCode::cancelled);
  EXPECT_EQ(codes.size(), 2U);
  EXPECT_TRUE(eventually([&] { return client_->info()->running == 0; }));
}

TEST_F(BatchTest, AServerThatDiesEndsItWithAnErrorForEveryTag) {
  const std::vector<OwnedProblem> problems = many_problems();
  std::vector<BatchProblem> batch;
  for (int i = 0; i < kMany; ++i) batch.push_back({.tag = i, .problem = problems[i].view()});
  int answers = 0;
  const auto take = [&](std::int64_t, const Expected<RemoteSolution>& answer) {
    if (++answers == 10) server_.send(SIGKILL);
    if (!answer) {
      EXPECT_EQ(answer.error().code, ErrorCode::unavailable);
    }
  };
  const auto done = client_->solve_batch(batch, take, {.wait = std::chrono::seconds(0)});
  ASSERT_FALSE(done.has_value());
  EXPECT_EQ(done.error().code, ErrorCode::unavailable);
  EXPECT_LE(answers, kMany);
  EXPECT_GE(answers, 10);
}

// A batch whose server is lost goes on at the next one, or at the same one once it is back.
constexpr int kOfLostBatch = 300, kKinds = 7, kBeforeLoss = 20;

class BatchLoss : public ::testing::Test {
 protected:
  BatchLoss() {
    for (int i = 0; i < kKinds; ++i) problems_.push_back(random_problem({}, static_cast<std::uint64_t>(i)));
  }

  void start(const std::string& listen = "") {
    std::vector<std::string> flags = {"--batch-window", "8", "--drain-grace-s", "60"};
    if (!listen.empty()) flags.insert(flags.end(), {"--listen", listen});
    servers_.push_back(std::make_unique<ServerProcess>(MARBLE_SERVER_BINARY, flags));
  }

  // Runs a batch; `at_some` is called once, when some problems have their answers.
  void run(const std::string& address, const std::function<void()>& at_some) {
    const Client client = Client::connect(address).value();
    std::vector<BatchProblem> batch;
    for (int i = 0; i < kOfLostBatch; ++i)
      batch.push_back({.tag = 1000 + i, .problem = problems_[i % kKinds].view()});
    const auto done = client.solve_batch(batch, [&](std::int64_t tag, Expected<RemoteSolution> answer) {
      ASSERT_TRUE(answer.has_value()) << answer.error().message();
      ++answers_[tag];
      EXPECT_EQ(answer->z, solve_in_process(problems_[(tag - 1000) % kKinds].view())->z) << tag;
      if (++answered_ == kBeforeLoss) at_some();
    });
    ASSERT_TRUE(done.has_value()) << done.error().message();
    EXPECT_EQ(answers_.size(), static_cast<std::size_t>(kOfLostBatch));
    for (const auto& [tag, count] : answers_) EXPECT_EQ(count, 1) << tag;
  }

  [[nodiscard]] ServerProcess& serving() {
    for (const auto& server : servers_) {
      if (Client::connect(server->address())->info()->answered > 0) return *server;
    }
    throw std::runtime_error("none has answered");
  }

  std::vector<OwnedProblem> problems_;
  std::vector<std::unique_ptr<ServerProcess>> servers_;
  std::map<std::int64_t, int> answers_;
  int answered_ = 0;
};

TEST_F(BatchLoss, AfterAKillEveryProblemIsAnsweredOnceByTheNextServer) {
  start();
  start();
  run(servers_[0]->address() + "," + servers_[1]->address(), [&] { serving().send(SIGKILL); });
}

TEST_F(BatchLoss, AfterADrainEveryProblemIsAnsweredOnceByTheNextServer) {
  start();
  start();
  run(servers_[0]->address() + "," + servers_[1]->address(), [&] { serving().terminate(); });
}

TEST_F(BatchLoss, AfterAKillItGoesOnWhereItsServerIsBack) {
  start();
  const std::string address = servers_[0]->address();
  run(address, [&] {
    servers_[0]->send(SIGKILL);
    static_cast<void>(servers_[0]->wait());
    start(address);
  });
}

TEST_F(BatchLoss, AfterARestartByTheBookItGoesOn) {
  start();
  const std::string address = servers_[0]->address();
  std::binary_semaphore terminated(0);
  auto batch = std::async(std::launch::async, [&] {
    run(address, [&] {
      servers_[0]->terminate();
      terminated.release();
    });
  });
  terminated.acquire();
  static_cast<void>(servers_[0]->wait());
  start(address);  // by this thread: a server ends with the one that started it
  batch.get();
}

TEST_F(BatchLoss, ASourceMayWaitForTheAnswersThatWereLost) {
  start();
  const std::string address = servers_[0]->address();
  const Client client = Client::connect(address).value();
  const v1::SolveRequest request = long_request();
  std::binary_semaphore answered(0);
  int given = 0;
  const BatchSource source = [&]() -> std::optional<BatchProblem> {
    if (given++ == 0)
      return BatchProblem{
          .tag = 1, .problem = view_of(request.problem()), .options = options_of(request.options()).value()};
    if (given == 2) {
      answered.acquire();
      return BatchProblem{.tag = 2, .problem = problems_[0].view()};
    }
    return std::nullopt;
  };
  std::vector<std::int64_t> tags;
  auto batch = std::async(std::launch::async, [&] {
    return client.solve_batch(source, [&](std::int64_t tag, Expected<RemoteSolution> answer) {
      EXPECT_TRUE(answer.has_value()) << answer.error().message();
      tags.push_back(tag);
      if (tag == 1) answered.release();
    });
  });
  const auto runs = [&] {
    const auto info = client.info();
    return info && info->running == 1;
  };
  ASSERT_TRUE(eventually(runs));
  servers_[0]->send(SIGKILL);
  static_cast<void>(servers_[0]->wait());
  start(address);
  ASSERT_TRUE(eventually(runs));
  const auto jobs = client.jobs().list({});
  ASSERT_TRUE(jobs.has_value());
  for (const auto& job : jobs->jobs) static_cast<void>(client.jobs().cancel(job.job_id));
  const auto done = batch.get();
  EXPECT_TRUE(done.has_value()) << done.error().message();
  EXPECT_EQ(tags, (std::vector<std::int64_t>{1, 2}));
}

TEST_F(BatchLoss, WhereNobodyComesBackEveryTagIsReported) {
  start();
  const Client client = Client::connect(servers_[0]->address()).value();
  std::vector<BatchProblem> batch;
  for (int i = 0; i < kOfLostBatch; ++i) batch.push_back({.tag = i, .problem = problems_[i % kKinds].view()});
  int answers = 0, errors = 0;
  const auto done = client.solve_batch(batch,
                                       [&](std::int64_t, Expected<RemoteSolution> answer) {
                                         if (!answer) {
                                           ++errors;
                                           EXPECT_EQ(answer.error().code, ErrorCode::unavailable);
                                         } else if (++answers == kBeforeLoss) {
                                           servers_[0]->send(SIGKILL);
                                         }
                                       },
                                       {.wait = std::chrono::milliseconds(300)});
  ASSERT_FALSE(done.has_value());
  EXPECT_EQ(done.error().code, ErrorCode::unavailable);
  EXPECT_GE(answers, kBeforeLoss);
  EXPECT_GE(errors, 1);
}

TEST_F(BatchLoss, AStopTokenEndsTheWaiting) {
  start();
  const Client client = Client::connect(servers_[0]->address()).value();
  const std::vector<BatchProblem> batch(kOfLostBatch, {.tag = 0, .problem = problems_[0].view()});
  std::stop_source stop;
  std::jthread stops;
  const auto done = client.solve_batch(batch,
                                       [&](std::int64_t, const Expected<RemoteSolution>& answer) {
                                         if (!answer || ++answered_ != kBeforeLoss) return;
                                         servers_[0]->send(SIGKILL);
                                         static_cast<void>(servers_[0]->wait());
                                         stop.request_stop();
                                       },
                                       {.stop = stop.get_token(), .wait = std::chrono::hours(1)});
  ASSERT_FALSE(done.has_value());
  EXPECT_EQ(done.error().code, ErrorCode::cancelled);
}

TEST_F(BatchLoss, WhatHasNoRoomIsSentAgainAndWhatNeverHasIsReported) {
  servers_.push_back(std::make_unique<ServerProcess>(
      MARBLE_SERVER_BINARY,
      std::vector<std::string>{"--workers", "1", "--client-queued", "1", "--queue-bytes", "4096"}));
  OwnedProblem large;
  large.g.assign(2000, 1.0);
  std::vector<BatchProblem> batch = {{.tag = -1, .problem = large.view()}};
  for (int i = 0; i < kBeforeLoss; ++i) batch.push_back({.tag = i, .problem = problems_[0].view()});
  const Client client = Client::connect(servers_[0]->address()).value();
  std::map<std::int64_t, std::string> outcomes;
  const auto done = client.solve_batch(batch, [&](std::int64_t tag, Expected<RemoteSolution> answer) {
    outcomes[tag] = answer ? "solved" : answer.error().message();
  });
  ASSERT_TRUE(done.has_value()) << done.error().message();
  EXPECT_NE(outcomes[-1], "solved");
  outcomes.erase(-1);
  EXPECT_EQ(outcomes.size(), static_cast<std::size_t>(kBeforeLoss));
  for (const auto& [tag, outcome] : outcomes) EXPECT_EQ(outcome, "solved") << tag;
}

TEST_F(BatchLoss, AWaitThatIsNoneIsRefused) {
  const Client client = Client::connect("127.0.0.1:1").value();
  const auto nothing = []() -> std::optional<BatchProblem> { return std::nullopt; };
  for (const double wait : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    const auto done =
        client.solve_batch(nothing, [](auto, const auto&) {}, {.wait = std::chrono::duration<double>(wait)});
    ASSERT_FALSE(done.has_value());
    EXPECT_EQ(done.error().field, "wait");
  }
}

}  // namespace
}  // namespace marble::testing
