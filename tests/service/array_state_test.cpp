// Arrays with --state-dir: what was accepted is kept, and each element has one answer, whenever the server
// ends.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cstdlib>
#include <random>
#include <thread>

#include "array_client.h"
#include "fleet_node.h"

namespace marble::testing {
namespace {

class ArrayState : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> flags(std::vector<std::string> more = {"--workers", "2"}) const {
    more.insert(more.end(), {"--state-dir", directory_.file("state")});
    return more;
  }
  static bool eventually_finished(Node& node, const std::string& id) {
    return eventually([&] { return node.job(id).state() == v1::JOB_STATE_FINISHED; });
  }
  static bool eventually_dead(Node& node) {
    return eventually([&] { return !node.server().running(); });
  }
  /// Changes the file of a server that is not running.
  void change(const std::string& sql) const {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open((directory_.file("state") + "/jobs.sqlite").c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  TemporaryDirectory directory_;
};

TEST_F(ArrayState, AnswersStayAndTheRestRunsAfterAKill) {
  auto node = std::make_unique<Node>(flags({"--workers", "1"}));
  std::vector<v1::ArrayElement> elements = elements_of(40);
  elements[20] = long_element();
  v1::ArraySetup setup;
  setup.set_name("forty");
  setup.set_request_id("forty");
  setup.set_priority(v1::PRIORITY_INTERACTIVE);
  const std::string id = submit_array(node->jobs(), elements, setup);
  std::vector<v1::ArrayResultsResponse> before;
  {
    ArrayReader reader(node->jobs(), id);
    for (int i = 0; i < 20; ++i) before.push_back(*reader.next());
  }
  ASSERT_TRUE(eventually([&] { return node->job(id).array().done() == 20; }));
  const v1::JobInfo reported = node->job(id);
  node->kill();
  node = std::make_unique<Node>(flags());
  const v1::JobInfo again = node->job(id);
  EXPECT_EQ(again.kind(), v1::JOB_KIND_ARRAY);
  EXPECT_EQ(again.priority(), v1::PRIORITY_INTERACTIVE);
  EXPECT_EQ(again.problem_name(), "forty");
  EXPECT_NEAR(again.accepted_unix_s(), reported.accepted_unix_s(), 1e-3);
  EXPECT_GE(again.array().done(), 20);
  EXPECT_EQ(submit_array(node->jobs(), elements, setup), id) << "sent again it is the same job";
  ArrayReader reader(node->jobs(), id);
  for (const v1::ArrayResultsResponse& one : before)
    EXPECT_EQ(reader.next()->SerializeAsString(), one.SerializeAsString()) << "to the last byte";
  ArrayReader rest(node->jobs(), id, 20);
  std::set<std::int64_t> indices;
  for (int i = 0; i < 19; ++i) {
    const auto answer = rest.next();
    ASSERT_TRUE(answer.has_value());
    EXPECT_EQ(answer->sequence(), 21 + i);
    indices.insert(answer->index());
  }
  EXPECT_EQ(indices.size(), 19U);
  EXPECT_FALSE(indices.contains(20))
      << "it ran when the server was killed, and runs again, beside the others";
  EXPECT_TRUE(node->cancel(id).ok());
  EXPECT_EQ(rest.next()->index(), 20);
  EXPECT_TRUE(rest.drain().empty());
  EXPECT_TRUE(rest.finish().ok()) << "all have an answer";
  node->kill();
  node = std::make_unique<Node>(flags());
  EXPECT_EQ(node->job(id).array().done(), 40);
  EXPECT_EQ(ArrayReader(node->jobs(), id).drain().size(), 40U);
  EXPECT_TRUE(node->remove(id).ok());
  node->kill();
  node = std::make_unique<Node>(flags());
  EXPECT_EQ(ArrayReader(node->jobs(), id).finish().error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(node->counters().request_bytes(), 0);
}

// At any moment: in the middle of a transaction, before and after a commit, while answers are written and
// read.
TEST_F(ArrayState, EachElementIsAnsweredOnceWheneverTheServerIsKilled) {
  constexpr int kElements = 600;
  std::mt19937 random(23);
  const std::vector<std::string> with = flags({"--workers", "2", "--job-starts", "1000"});
  auto node = std::make_unique<Node>(with);
  const std::string id = submit_array(node->jobs(), elements_of(kElements));
  std::vector<v1::ArrayResultsResponse> received;
  while (received.size() < kElements) {
    const std::size_t enough = received.size() + 1 + random() % 150;
    {
      ArrayReader reader(node->jobs(), id, received.empty() ? 0 : received.back().sequence());
      while (auto answer = reader.next()) {
        received.push_back(std::move(*answer));
        if (received.size() == enough) node->server().send(SIGKILL);
      }
    }
    if (received.size() >= kElements) break;
    ASSERT_TRUE(eventually_dead(*node));
    node = nullptr;
    const std::string moments[] = {"before_commit", "after_commit", "before_answer", "none"};
    while (node == nullptr)
      node = faulty_node(with, moments[random() % 4] + ":" + std::to_string(3 + random() % 40));
  }
  expect_numbered(received, kElements);
}

TEST_F(ArrayState, NothingIsLeftOfOneThatHadNotComeWhole) {
  auto node = std::make_unique<Node>(flags());
  ArraySubmission half(node->jobs());
  v1::ArraySetup setup;
  setup.set_request_id("half");
  ASSERT_TRUE(half.setup(setup));
  for (std::int64_t index = 0; index < 10; ++index) ASSERT_TRUE(half.element(numbered_element(index)));
  ASSERT_TRUE(eventually([&] { return node->counters().request_bytes() > 2000; }));
  node->kill();
  node = std::make_unique<Node>(flags());
  EXPECT_TRUE(node->list().empty());
  EXPECT_EQ(node->counters().request_bytes(), 0);
  expect_numbered(ArrayReader(node->jobs(), submit_array(node->jobs(), elements_of(10), setup)).drain(), 10);
}

TEST_F(ArrayState, WhatAStopInterruptsBeginsAgain) {
  auto node = std::make_unique<Node>(flags({"--workers", "1", "--drain-grace-s", "0"}));
  std::vector<v1::ArrayElement> elements = elements_of(10);
  elements[3] = long_element();
  const std::string id = submit_array(node->jobs(), elements);
  ASSERT_TRUE(eventually([&] { return node->job(id).array().done() == 3; }));
  node->stop();
  node = std::make_unique<Node>(flags({"--workers", "2"}));
  ArrayReader reader(node->jobs(), id);
  for (int i = 0; i < 9; ++i) EXPECT_NE(reader.next()->index(), 3);
  EXPECT_EQ(node->job(id).array().done(), 9);
  EXPECT_TRUE(node->cancel(id).ok());
  EXPECT_EQ(reader.drain().size(), 1U);
}

TEST_F(ArrayState, CancelledStaysCancelled) {
  auto node = std::make_unique<Node>(flags({"--workers", "1"}));
  std::vector<v1::ArrayElement> elements = elements_of(10);
  elements[1] = long_element();
  const std::string id = submit_array(node->jobs(), elements);
  ASSERT_TRUE(eventually([&] { return node->job(id).array().done() == 1; }));
  EXPECT_TRUE(node->cancel(id).ok());
  node->kill();
  node = std::make_unique<Node>(flags());
  ASSERT_TRUE(eventually_finished(*node, id));
  EXPECT_LT(node->job(id).array().done(), 10);
  ArrayReader reader(node->jobs(), id);
  EXPECT_GE(reader.drain().size(), 1U);
  EXPECT_EQ(reader.finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(node->counters().running(), 0);
}

TEST_F(ArrayState, AnElementThatStopsItsServerIsSetAsideAndTheOthersGoOn) {
  constexpr int kElements = 12;
  const std::vector<std::string> with = flags({"--workers", "2"});
  const std::string fault = "job=fatal.5";
  auto node = faulty_node(with, fault);
  ASSERT_NE(node, nullptr);
  v1::ArraySetup setup;
  setup.set_request_id("fatal");
  std::string id;  // the server may die before it answers
  (void)submit_array(node->jobs(), setup, elements_of(kElements), &id);
  for (int death = 0; death < 2; ++death) {
    if (node != nullptr) {
      ASSERT_TRUE(eventually_dead(*node)) << node->server().log();
    }
    node = faulty_node(with, fault);
  }
  ASSERT_NE(node, nullptr);
  id = submit_array(node->jobs(), elements_of(kElements), setup);
  expect_set_aside(node->jobs(), id, 5, kElements);
  EXPECT_EQ(node->job(id).array().failed(), 1);
  EXPECT_EQ(node->server().log_lines({"job_set_aside", id + ".5"}).size(), 1U) << node->server().log();
}

TEST_F(ArrayState, AnExceptionInAnElementIsItsErrorAlone) {
  const auto node = faulty_node(flags(), "job!odd.1");
  ASSERT_NE(node, nullptr);
  v1::ArraySetup setup;
  setup.set_request_id("odd");
  ArrayReader reader(node->jobs(), submit_array(node->jobs(), elements_of(3), setup));
  for (const v1::ArrayResultsResponse& answer : reader.drain())
    EXPECT_EQ(answer.has_error(), answer.index() == 1);
  EXPECT_TRUE(reader.finish().ok());
}

TEST_F(ArrayState, DamagedRowsAreErrorsOfTheirElements) {
  auto node = std::make_unique<Node>(flags({"--workers", "1"}));
  std::vector<v1::ArrayElement> elements = elements_of(6);
  elements[2] = long_element();
  const std::string id = submit_array(node->jobs(), elements);
  const std::string headless = submit_array(node->jobs(), elements_of(2));
  ASSERT_TRUE(eventually([&] { return node->job(id).array().done() == 2; }));
  node->kill();
  change("UPDATE elements SET answer = x'ffff' WHERE place = 0 AND sequence = 1");
  change(
      "UPDATE elements SET request = 'no element' WHERE place = 3;"
      "DELETE FROM elements WHERE place = 4;"
      "UPDATE elements SET lost = 0");
  change("UPDATE jobs SET request = x'ffff' WHERE id = '" + headless + "'");
  node = std::make_unique<Node>(flags({"--workers", "2"}));
  ArrayReader reader(node->jobs(), id);
  std::set<std::int64_t> failed;
  for (int i = 0; i < 5; ++i) {
    const auto answer = reader.next();
    ASSERT_TRUE(answer.has_value());
    EXPECT_EQ(answer->sequence(), i + 1);
    if (answer->has_error()) failed.insert(answer->index());
  }
  EXPECT_EQ(failed, (std::set<std::int64_t>{0, 3, 4}));
  EXPECT_TRUE(node->cancel(id).ok());
  EXPECT_EQ(reader.drain().size(), 1U);
  ASSERT_TRUE(eventually_finished(*node, headless));
  EXPECT_EQ(ArrayReader(node->jobs(), headless).finish().error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_TRUE(node->solves());
}

TEST_F(ArrayState, ExpiresWithItsAnswers) {
  auto node = std::make_unique<Node>(flags({"--result-keep-s", "0.5"}));
  const std::string id = submit_array(node->jobs(), elements_of(5));
  EXPECT_TRUE(eventually(
      [&] { return ArrayReader(node->jobs(), id).finish().error_code() == grpc::StatusCode::NOT_FOUND; }));
  node->stop();
  node = std::make_unique<Node>(flags());
  EXPECT_EQ(ArrayReader(node->jobs(), id).finish().error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(ArrayState, AFileOfAnEarlierServerIsUpgraded) {
  auto node = std::make_unique<Node>(flags());
  const std::string before = node->submit(numbered(1));
  expect_answer(*node, before, 1);
  node->stop();
  change(
      "DROP INDEX elements_answered; DROP TABLE elements; ALTER TABLE jobs DROP COLUMN elements;"
      "PRAGMA user_version = 2");
  node = std::make_unique<Node>(flags());
  expect_answer(*node, before, 1);
  expect_numbered(ArrayReader(node->jobs(), submit_array(node->jobs(), elements_of(10))).drain(), 10);
}

}  // namespace
}  // namespace marble::testing
