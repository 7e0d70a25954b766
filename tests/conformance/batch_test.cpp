// Many problems on one stream.
#include "marble/batch.h"

#include <gtest/gtest.h>

#include <map>

#include "marble/client.h"
#include "marble/convert.h"
#include "problems.h"
#include "support/random_problem.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
