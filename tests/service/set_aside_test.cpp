// A job that takes its server with it: after two servers it ends with that reason, and all other jobs go on.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <map>

#include "fleet_node.h"
#include "support/postgres_process.h"

namespace marble::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kFatal = "fatal";  // the request id of the job that ends its server

v1::SolveRequest fatal_request() {
  v1::SolveRequest request = numbered(1000);
  request.set_request_id(kFatal);
  return request;
}

class SetAside : public ::testing::Test {
 protected:
  [[nodiscard]] static std::unique_ptr<Node> start(const std::vector<std::string>& flags,
                                                   const std::string& fault = std::string("job=") + kFatal) {
    return faulty_node(flags, fault);
  }
  static void expect_death(const std::unique_ptr<Node>& node) {
    if (node == nullptr) return;
    ASSERT_TRUE(eventually([&] { return !node->server().running(); })) << node->server().log();
    EXPECT_EQ(node->server().wait(), -SIGKILL) << node->server().log();
  }
  static bool eventually_runs(Node& node, const std::string& id) {
    return eventually([&] { return node.job(id).state() == v1::JOB_STATE_RUNNING; });
  }
  static void expect_set_aside(Node& node, const std::string& id, const std::string& times) {
    v1::SolveResponse response;
    const grpc::Status status = node.result(id, true, &response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INTERNAL) << status.error_message();
    EXPECT_THAT(status.error_message(), HasSubstr("the server stopped " + times + " while it ran this job"));
    EXPECT_EQ(node.job(id).state(), v1::JOB_STATE_FINISHED);
    EXPECT_THAT(node.job(id).error().message(), HasSubstr("the server stopped " + times));
  }
  [[nodiscard]] std::vector<std::string> flags(std::vector<std::string> more = {"--workers", "1"}) const {
    more.insert(more.end(), {"--state-dir", directory_.file("state")});
    return more;
  }

  TemporaryDirectory directory_;
};

TEST_F(SetAside, OneServerEndsTheJobAfterTwoStartsAndAnswersAllOthers) {
  constexpr int kOthers = 6;
  auto node = start(flags());
  const std::string first = node->submit(long_request());
  ASSERT_TRUE(eventually_runs(*node, first));
  std::map<std::string, int> others;
  std::string fatal;
  for (int i = 0; i < kOthers; ++i) {
    others.emplace(node->submit(numbered(i)), i);
    if (i == kOthers / 2) fatal = node->submit(fatal_request());
  }
  for (int death = 0; death < 2; ++death) {
    if (node != nullptr) (void)node->cancel(first);  // the server may die before this is on disk
    expect_death(node);
    node = start(flags());
  }
  ASSERT_NE(node, nullptr);
  expect_set_aside(*node, fatal, "twice");
  (void)node->cancel(first);
  for (const auto& [id, number] : others) expect_answer(*node, id, number);
  EXPECT_EQ(node->server().log_lines({"job_set_aside", fatal, kFatal}).size(), 1U) << node->server().log();
  EXPECT_TRUE(node->bundle(fatal).ok());  // for a bug report
  EXPECT_EQ(node->submit(fatal_request()), fatal) << "sent again it is the same job";
  node->kill();
  node = start(flags());
  ASSERT_NE(node, nullptr);
  expect_set_aside(*node, fatal, "twice");
  EXPECT_TRUE(node->bundle(fatal).ok());
  EXPECT_TRUE(node->solves());
}

TEST_F(SetAside, AJobThatRanBesideItIsNotSetAside) {
  const std::vector<std::string> two = flags({"--workers", "2"});
  auto node = start(two, "");
  const std::string beside = node->submit(long_request());
  v1::SolveRequest request = long_request();
  request.set_request_id(kFatal);
  const std::string fatal = node->submit(request);
  ASSERT_TRUE(eventually_runs(*node, beside) && eventually_runs(*node, fatal));
  node->kill();
  node = start(two);
  ASSERT_NE(node, nullptr) << "the job that was accepted first runs first, and by itself";
  ASSERT_TRUE(eventually_runs(*node, beside));
  for (int i = 0; i < 3; ++i) expect_answer(*node, node->submit(numbered(i)), i);
  EXPECT_EQ(node->job(fatal).state(), v1::JOB_STATE_QUEUED);
  (void)node->cancel(beside);  // the server may die before it answers
  expect_death(node);
  node = start(two);
  ASSERT_NE(node, nullptr);
  expect_set_aside(*node, fatal, "twice");
  (void)node->cancel(beside);
  v1::SolveResponse response;  // it had ended before or after its best iterate was on disk
  const grpc::Status ended = node->result(beside, true, &response);
  EXPECT_TRUE(ended.ok() || ended.error_code() == grpc::StatusCode::CANCELLED) << ended.error_message();
}

TEST_F(SetAside, ASuspectThatWaitsCanBeCancelledAndDeleted) {
  auto node = start(flags({"--workers", "3"}), "");
  std::vector<std::string> ids;
  for (int i = 0; i < 3; ++i) ids.push_back(node->submit(long_request()));
  for (const std::string& id : ids) ASSERT_TRUE(eventually_runs(*node, id));
  node->kill();
  node = start(flags({"--workers", "3"}), "");
  ASSERT_NE(node, nullptr);
  ASSERT_TRUE(eventually_runs(*node, ids[0]));
  EXPECT_EQ(node->job(ids[1]).state(), v1::JOB_STATE_QUEUED) << "one at a time";
  EXPECT_TRUE(node->cancel(ids[1]).ok());
  v1::SolveResponse response;
  EXPECT_EQ(node->result(ids[1], true, &response).error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(node->remove(ids[0]).ok());
  ASSERT_TRUE(eventually_runs(*node, ids[2])) << "the next one's turn";
  EXPECT_TRUE(node->remove(ids[2]).ok());
  EXPECT_TRUE(eventually([&] { return node->counters().running() == 0; }));
  node->kill();
  node = start(flags(), "");
  EXPECT_EQ(node->list(), std::set<std::string>{ids[1]});
}

TEST_F(SetAside, AStopIsNoLossAndTheNumberOfStartsIsASetting) {
  const std::vector<std::string> once =
      flags({"--workers", "1", "--job-starts", "1", "--drain-grace-s", "0"});
  auto node = start(once, "");
  const std::string running = node->submit(long_request()), waiting = node->submit(numbered(1));
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(eventually_runs(*node, running));
    node->stop();
    node = start(once, "");
  }
  ASSERT_TRUE(eventually_runs(*node, running));
  node->kill();
  node = start(once, "");
  expect_set_aside(*node, running, "once");
  expect_answer(*node, waiting, 1);
}

TEST_F(SetAside, AnExceptionWhileAJobIsTakenEndsThatJobOnly) {
  auto node = start(flags(), "");
  const std::string first = node->submit(long_request());
  const std::string fatal = node->submit(fatal_request()), other = node->submit(numbered(1));
  node->kill();
  node = start(flags(), std::string("take!") + kFatal);
  ASSERT_NE(node, nullptr);
  v1::SolveResponse response;
  EXPECT_EQ(node->result(fatal, true, &response).error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_TRUE(node->cancel(first).ok());
  expect_answer(*node, other, 1);
}

class FleetSetAside : public SetAside {
 protected:
  [[nodiscard]] std::vector<std::string> flags() const {
    return {"--workers", "1", "--state-lease-s", "1", "--state", database_.uri()};
  }
  [[nodiscard]] std::vector<std::unique_ptr<Node>> start_four() const {
    std::vector<std::unique_ptr<Node>> nodes;
    for (int i = 0; i < 4; ++i) nodes.push_back(start(flags()));
    return nodes;
  }

  PostgresProcess database_{MARBLE_POSTGRES_DIR};
};

TEST_F(FleetSetAside, OneJobCostsTwoOfFourServersAndNothingElseIsLost) {
  constexpr int kOthers = 12;
  const auto nodes = start_four();
  std::map<std::string, int> others;
  std::string fatal;
  const auto submit = [&](const v1::SolveRequest& request, std::string* id) {
    std::size_t at = 0;
    ASSERT_TRUE(eventually([&] { return nodes[at++ % nodes.size()]->submit(request, id).ok(); }));
  };
  for (int i = 0; i < kOthers; ++i) {
    std::string id;
    submit(numbered(i), &id);
    others.emplace(id, i);
    if (i == kOthers / 2) submit(fatal_request(), &fatal);
  }
  const auto dead = [&] {
    return std::ranges::count_if(nodes, [](const auto& node) { return !node->server().running(); });
  };
  ASSERT_TRUE(eventually([&] { return dead() == 2; }));
  const auto alive = std::ranges::find_if(nodes, [](const auto& node) { return node->server().running(); });
  expect_set_aside(**alive, fatal, "twice");
  for (const auto& [id, number] : others) expect_answer(**alive, id, number);
  EXPECT_EQ(dead(), 2);
  EXPECT_TRUE((*alive)->bundle(fatal).ok());
  EXPECT_EQ(database_.ask("SELECT count(*) FROM marble_answers"), std::to_string(kOthers + 1));
  EXPECT_EQ(database_.ask("SELECT count(*) FROM marble_jobs WHERE state <> 2"), "0");
  for (const auto& node : nodes) {
    if (node->server().running()) {
      EXPECT_TRUE(node->solves());
    }
  }
}

TEST_F(FleetSetAside, AnExceptionWhileAJobIsTakenEndsThatJobOnly) {
  const auto node = start(flags(), std::string("take!") + kFatal);
  const std::string fatal = node->submit(fatal_request()), other = node->submit(numbered(1));
  v1::SolveResponse response;
  EXPECT_EQ(node->result(fatal, true, &response).error_code(), grpc::StatusCode::INTERNAL);
  expect_answer(*node, other, 1);
  EXPECT_EQ(database_.ask("SELECT max(lost) FROM marble_jobs"), "0");
}

}  // namespace
}  // namespace marble::testing
