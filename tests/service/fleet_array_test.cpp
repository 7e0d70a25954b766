// --state: arrays. Submitted anywhere, run by one server after another, read anywhere, each element answered
// once.
#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "array_client.h"
#include "fleet_node.h"
#include "support/postgres_process.h"

namespace marble::testing {
namespace {

using ::testing::HasSubstr;

class FleetArrays : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> flags(std::vector<std::string> more = {}) const {
    for (const char* flag : {"--workers", "--state-lease-s"}) {
      if (std::ranges::find(more, flag) == more.end()) more.insert(more.end(), {flag, "1"});
    }
    more.insert(more.end(), {"--state", database_.uri()});
    return more;
  }
  [[nodiscard]] std::unique_ptr<Node> start(std::vector<std::string> more = {}) {
    return std::make_unique<Node>(flags(std::move(more)));
  }
  /// `count` numbered elements, of which this one does not end by itself.
  static std::vector<v1::ArrayElement> with_long(std::int64_t count, std::size_t which) {
    std::vector<v1::ArrayElement> elements = elements_of(count);
    elements[which] = long_element();
    return elements;
  }
  static bool eventually_done(Node& node, const std::string& id, std::int64_t done) {
    return eventually([&] { return node.job(id).array().done() == done; });
  }
  static bool eventually_finished(Node& node, const std::string& id) {
    return eventually([&] { return node.job(id).state() == v1::JOB_STATE_FINISHED; });
  }
  static bool eventually_dead(Node& node) {
    return eventually([&] { return !node.server().running(); });
  }
  static bool eventually_gone(Node& node, const std::string& id) {
    return eventually(
        [&] { return ArrayReader(node.jobs(), id).finish().error_code() == grpc::StatusCode::NOT_FOUND; });
  }

  PostgresProcess database_{MARBLE_POSTGRES_DIR};
};

TEST_F(FleetArrays, AnyServerReadsWhatAnyOtherRuns) {
  const auto a = start(), b = start();
  v1::ArraySetup setup;
  setup.set_name("forty");
  setup.set_request_id("forty");
  const std::string id = submit_array(a->jobs(), elements_of(40), setup);
  for (Node* node : {b.get(), a.get()}) {
    ArrayReader reader(node->jobs(), id);
    expect_numbered(reader.drain(), 40);
    EXPECT_TRUE(reader.finish().ok());
    EXPECT_EQ(ArrayReader(node->jobs(), id, 30).drain().size(), 10U);
    ASSERT_TRUE(eventually_finished(*node, id));
    const v1::JobInfo job = node->job(id);
    EXPECT_EQ(job.kind(), v1::JOB_KIND_ARRAY);
    EXPECT_EQ(job.problem_name(), "forty");
    EXPECT_EQ(job.array().done(), 40);
    EXPECT_EQ(job.array().solved(), 40);
    EXPECT_TRUE(node->list().contains(id));
    v1::SolveResponse response;
    EXPECT_EQ(node->result(id, true, &response).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  }
  EXPECT_EQ(a->job(id).server(), b->job(id).server());
  EXPECT_EQ(submit_array(b->jobs(), elements_of(40), setup), id) << "sent again it is the same job";
  std::string other;
  const grpc::Status status = submit_array(b->jobs(), setup, elements_of(39), &other);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
  EXPECT_EQ(bad_field(status).field(), "request_id");
  EXPECT_TRUE(b->remove(id).ok());
  EXPECT_EQ(ArrayReader(a->jobs(), id).finish().error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(ArrayReader(a->jobs(), "none").finish().error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_TRUE(eventually([&] { return database_.ask("SELECT count(*) FROM marble_elements") == "0"; }));
}

TEST_F(FleetArrays, AnyServerSendsItsResultsOverPlainHttpToo) {
  const auto a = start(), b = start({"--http", "127.0.0.1:0"});
  const std::string id = submit_array(a->jobs(), elements_of(5));
  httplib::Client there(b->server().http());
  there.set_read_timeout(120);
  std::int64_t after = 0;
  while (after < 5) {
    const auto page = there.Get("/api/jobs/" + id + "/results?wait=30&after=" + std::to_string(after));
    ASSERT_EQ(page->status, 200) << page->body;
    after += std::ranges::count(page->body, '\n');
  }
  EXPECT_EQ(there.Get("/api/jobs/" + id + "/results?wait=30&after=5")->status, 204);
  EXPECT_EQ(there.Get("/api/jobs/none/results")->status, 404);
}

TEST_F(FleetArrays, AReaderOnAnotherServerFollowsAndWatchesItsProgress) {
  const auto a = start();
  const std::string id = submit_array(a->jobs(), with_long(10, 4));
  const auto b = start();
  ArrayReader reader(b->jobs(), id);
  for (int i = 1; i <= 4; ++i) EXPECT_EQ(reader.next()->sequence(), i);
  ASSERT_TRUE(eventually_done(*b, id, 4));
  EXPECT_EQ(b->job(id).state(), v1::JOB_STATE_RUNNING);
  EXPECT_EQ(b->job(id).array().elements(), 10);
  EXPECT_TRUE(b->cancel(id).ok());
  const auto rest = reader.drain();
  EXPECT_TRUE(std::ranges::any_of(rest, [](const auto& one) { return one.index() == 4 && one.has_result(); }))
      << "what ran returns its best iterate";
  EXPECT_EQ(reader.finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(a->job(id).array().done(), 4 + static_cast<std::int64_t>(rest.size()));
  EXPECT_LT(a->job(id).array().done(), 10);
  EXPECT_TRUE(eventually([&] {
    return database_.ask("SELECT count(*) FROM marble_elements WHERE sequence IS NULL") == "0";
  })) << "requests that are not needed any more go";
  EXPECT_TRUE(eventually([&] { return a->solves(); }));
  EXPECT_EQ(a->counters().request_bytes(), 0);
}

TEST_F(FleetArrays, OneThatWaitsIsCancelledOnAnyServer) {
  const auto a = start(), b = start();
  std::vector<std::string> busy;
  for (Node* node : {a.get(), b.get()}) {
    busy.push_back(node->submit(long_request()));
    ASSERT_TRUE(eventually([&] { return node->job(busy.back()).state() == v1::JOB_STATE_RUNNING; }));
  }
  const std::string id = submit_array(a->jobs(), elements_of(3));
  EXPECT_EQ(b->job(id).state(), v1::JOB_STATE_QUEUED);
  ArrayReader reader(a->jobs(), id);
  EXPECT_TRUE(b->cancel(id).ok());
  EXPECT_TRUE(reader.drain().empty());
  EXPECT_EQ(reader.finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(a->job(id).state(), v1::JOB_STATE_FINISHED);
  EXPECT_EQ(a->job(id).array().elements(), 3);
  for (const std::string& one : busy) EXPECT_TRUE(a->cancel(one).ok());
}

TEST_F(FleetArrays, OtherJobsTakeTurnsWithItsElements) {
  const auto a = start();
  const std::string id = submit_array(a->jobs(), elements_of(2, [](std::int64_t) { return long_element(); }));
  ASSERT_TRUE(eventually([&] { return a->counters().running() == 1; }));
  const std::string other = a->submit(numbered(1));
  ASSERT_TRUE(eventually([&] { return !a->job(other).server().empty(); })) << "taken, though all are busy";
  EXPECT_TRUE(a->cancel(id).ok());
  expect_answer(*a, other, 1);
  EXPECT_EQ(ArrayReader(a->jobs(), id).finish().error_code(), grpc::StatusCode::CANCELLED);
}

TEST_F(FleetArrays, SurvivorsRepeatOnlyWhatHasNoAnswer) {
  auto a = start();
  const std::string id = submit_array(a->jobs(), with_long(40, 20));
  ASSERT_TRUE(eventually_done(*a, id, 20));
  const auto b = start({"--workers", "2"});
  std::vector<v1::ArrayResultsResponse> before;
  {
    ArrayReader reader(b->jobs(), id);
    for (int i = 0; i < 20; ++i) before.push_back(*reader.next());
  }
  const std::string holder = b->job(id).server();
  a->kill();
  ArrayReader again(b->jobs(), id);
  for (const v1::ArrayResultsResponse& one : before)
    EXPECT_EQ(again.next()->SerializeAsString(), one.SerializeAsString()) << "to the last byte";
  std::set<std::int64_t> indices;
  for (int i = 0; i < 19; ++i) {
    const auto answer = again.next();
    ASSERT_TRUE(answer.has_value());
    EXPECT_EQ(answer->sequence(), 21 + i);
    indices.insert(answer->index());
  }
  EXPECT_EQ(indices.size(), 19U);
  EXPECT_FALSE(indices.contains(20)) << "it runs again, beside the others";
  EXPECT_EQ(b->server().log_lines({"job_taken_over", id}).size(), 1U);
  EXPECT_NE(b->job(id).server(), holder);
  EXPECT_TRUE(b->cancel(id).ok());
  EXPECT_EQ(again.next()->index(), 20);
  EXPECT_TRUE(again.drain().empty());
  EXPECT_TRUE(again.finish().ok()) << "all have an answer";
}

// The server that others thought dead goes on; what it makes of the array is not taken.
TEST_F(FleetArrays, OnlyItsHolderAnswers) {
  const auto a = start();
  const std::string id = submit_array(a->jobs(), with_long(10, 3));
  ASSERT_TRUE(eventually_done(*a, id, 3));
  const std::string before = a->job(id).server();
  const auto b = start({"--workers", "2"});
  a->server().send(SIGSTOP);
  ASSERT_TRUE(eventually_done(*b, id, 9)) << b->server().log();
  a->server().send(SIGCONT);
  ASSERT_TRUE(eventually([&] { return a->solves(); })) << "it releases the array";
  ASSERT_TRUE(eventually([&] { return a->job(id).server() != before; }));
  EXPECT_EQ(a->job(id).state(), v1::JOB_STATE_RUNNING);
  EXPECT_TRUE(a->cancel(id).ok());
  ArrayReader here(a->jobs(), id), there(b->jobs(), id);
  const auto answers = here.drain();
  EXPECT_EQ(answers.size(), 10U);
  EXPECT_EQ(there.drain().size(), 10U);
  EXPECT_EQ(database_.ask("SELECT count(DISTINCT sequence) FROM marble_elements"), "10");
}

TEST_F(FleetArrays, AServerThatStopsGivesItBackAtOnce) {
  auto a = start({"--drain-grace-s", "0", "--state-lease-s", "3600"});
  const std::string id = submit_array(a->jobs(), with_long(10, 3));
  ASSERT_TRUE(eventually_done(*a, id, 3));
  const auto b = start({"--workers", "2", "--state-lease-s", "3600"});
  a->stop();
  ArrayReader reader(b->jobs(), id);
  for (int i = 0; i < 9; ++i) EXPECT_NE(reader.next()->index(), 3);
  EXPECT_EQ(database_.ask("SELECT max(lost) FROM marble_elements"), "0") << "a stop is no element's fault";
  EXPECT_TRUE(b->cancel(id).ok());
  EXPECT_EQ(reader.drain().size(), 1U);
}

// Otherwise it would wait for them in vain, and then cut their connections.
TEST_F(FleetArrays, AServerThatStopsSendsReadersOfOtherServersArraysElsewhere) {
  const auto a = start();
  const std::string id = submit_array(a->jobs(), with_long(10, 4));
  ASSERT_TRUE(eventually_done(*a, id, 4));
  const auto b = start();
  ArrayReader reader(b->jobs(), id);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(reader.next().has_value());
  b->server().terminate();
  EXPECT_FALSE(reader.next().has_value());
  const grpc::Status status = reader.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_THAT(status.error_message(), HasSubstr("the server is draining"));
  EXPECT_EQ(b->server().wait(), 0);
  EXPECT_TRUE(a->cancel(id).ok());
}

TEST_F(FleetArrays, AnElementThatStopsItsServersIsSetAsideAndTheOthersGoOn) {
  constexpr int kElements = 12;
  const std::vector<std::string> with = flags({"--workers", "2"});
  const std::string fault = "job=fatal.5";
  v1::ArraySetup setup;
  setup.set_request_id("fatal");
  std::string id;  // the server may die before it answers
  for (int death = 0; death < 2; ++death) {
    const auto node = faulty_node(with, fault);
    if (node == nullptr) continue;
    if (death == 0) (void)submit_array(node->jobs(), setup, elements_of(kElements), &id);
    ASSERT_TRUE(eventually_dead(*node)) << node->server().log();
  }
  const auto node = faulty_node(with, fault);
  ASSERT_NE(node, nullptr);
  id = submit_array(node->jobs(), elements_of(kElements), setup);
  expect_set_aside(node->jobs(), id, 5, kElements);
  EXPECT_EQ(node->server().log_lines({"job_set_aside", id + ".5"}).size(), 1U) << node->server().log();
}

TEST_F(FleetArrays, DamagedRowsAreErrorsOfTheirElements) {
  auto a = start();
  const std::string id = submit_array(a->jobs(), with_long(8, 2));
  ASSERT_TRUE(eventually_done(*a, id, 2));
  a->kill();
  (void)database_.ask("UPDATE marble_elements SET answer = '\\xffff' WHERE sequence = 1");
  (void)database_.ask("UPDATE marble_elements SET answer = NULL WHERE sequence = 2");
  (void)database_.ask("UPDATE marble_elements SET request = '\\xffff' WHERE place = 3");
  (void)database_.ask("UPDATE marble_elements SET request = NULL WHERE place = 4");
  (void)database_.ask("DELETE FROM marble_elements WHERE place = 5");
  (void)database_.ask(
      "UPDATE marble_elements SET lost = -7, claimed = 9, iterations = 9223372036854775807 WHERE place = 6");
  const auto b = start({"--workers", "2"});
  ArrayReader reader(b->jobs(), id);
  std::set<std::int64_t> failed;
  for (int i = 0; i < 7; ++i) {
    const auto answer = reader.next();
    ASSERT_TRUE(answer.has_value());
    EXPECT_EQ(answer->sequence(), i + 1);
    if (answer->has_error()) failed.insert(answer->index());
  }
  EXPECT_EQ(failed, (std::set<std::int64_t>{0, 1, 3, 4, 5}));
  EXPECT_TRUE(b->cancel(id).ok());
  EXPECT_EQ(reader.drain().size(), 1U);
  EXPECT_TRUE(b->solves());
}

TEST_F(FleetArrays, ADamagedArrayIsOneFailedJob) {
  auto a = start();
  const std::string whole = submit_array(a->jobs(), with_long(2, 0));
  ASSERT_TRUE(eventually([&] { return a->counters().running() == 1; }));
  std::vector<std::string> broken;
  for (int i = 0; i < 4; ++i) broken.push_back(submit_array(a->jobs(), elements_of(6)));
  a->kill();
  const auto of = [&](std::size_t which) { return " WHERE id = '" + broken[which] + "'"; };
  const auto number = [&](std::size_t which) { return "(SELECT number FROM marble_jobs" + of(which) + ")"; };
  (void)database_.ask("UPDATE marble_jobs SET state = 0, token = '', elements = 9223372036854775807" + of(0));
  (void)database_.ask("UPDATE marble_jobs SET state = 0, token = ''" + of(1) + " OR id = '" + broken[2] +
                      "' OR id = '" + broken[3] + "'");
  (void)database_.ask("UPDATE marble_requests SET request = '\\xffff' WHERE number = " + number(1));
  (void)database_.ask("DELETE FROM marble_elements WHERE place > 1 AND job = " + number(2));
  (void)database_.ask("UPDATE marble_elements SET sequence = 9223372036854775807 WHERE place = 1 AND job = " +
                      number(3));
  const auto b = start({"--workers", "4"});
  for (const std::string& id : broken) {
    ASSERT_TRUE(eventually_finished(*b, id)) << b->server().log();
    ArrayReader reader(b->jobs(), id);
    EXPECT_EQ(reader.finish().error_code(), grpc::StatusCode::INTERNAL);
  }
  EXPECT_TRUE(b->solves());
  EXPECT_TRUE(b->cancel(whole).ok());
}

TEST_F(FleetArrays, NothingIsLeftOfOneThatHadNotComeWhole) {
  auto a = start();
  const auto b = start();
  ArraySubmission half(a->jobs()), left(b->jobs());
  v1::ArraySetup setup;
  setup.set_request_id("half");
  for (ArraySubmission* one : {&half, &left}) {
    ASSERT_TRUE(one->setup(setup));
    for (std::int64_t index = 0; index < 10; ++index) ASSERT_TRUE(one->element(numbered_element(index)));
  }
  ASSERT_TRUE(eventually([&] { return database_.ask("SELECT count(*) FROM marble_elements") == "20"; }));
  EXPECT_TRUE(b->list().empty()) << "no one sees it yet";
  left.cancel();
  EXPECT_TRUE(eventually([&] { return database_.ask("SELECT count(*) FROM marble_elements") == "10"; }));
  a->kill();
  EXPECT_TRUE(eventually([&] { return database_.ask("SELECT count(*) FROM marble_elements") == "0"; }));
  expect_numbered(ArrayReader(b->jobs(), submit_array(b->jobs(), elements_of(10), setup)).drain(), 10);
}

TEST_F(FleetArrays, BoundsHoldForAllServersTogether) {
  const std::vector<std::string> with = {"--array-elements", "20", "--client-queued", "2"};
  const auto a = start(with), b = start(with);
  std::string id;
  grpc::Status status = submit_array(a->jobs(), {}, elements_of(21), &id);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("array_elements"));
  ASSERT_TRUE(submit_array(a->jobs(), {}, elements_of(20), &id).ok());
  expect_numbered(ArrayReader(b->jobs(), id).drain(), 20);
  ArraySubmission first(a->jobs()), second(b->jobs());
  ASSERT_TRUE(first.setup({}));
  ASSERT_TRUE(second.setup({}));
  ASSERT_TRUE(
      eventually([&] { return database_.ask("SELECT count(*) FROM marble_jobs WHERE state = 4") == "2"; }));
  for (Node* node : {a.get(), b.get()}) {
    status = submit_array(node->jobs(), {}, elements_of(2), &id);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
    EXPECT_THAT(status.error_message(), HasSubstr("client_queued"));
    EXPECT_TRUE(retry_info(status).has_value());
  }
  second.cancel();
  EXPECT_TRUE(eventually([&] { return submit_array(b->jobs(), {}, elements_of(2), &id).ok(); }));
}

TEST_F(FleetArrays, BytesOfArraysCountOnAllServers) {
  const std::vector<std::string> with = {"--client-bytes", "6000"};
  const auto a = start(with), b = start(with);
  ArraySubmission first(a->jobs());
  ASSERT_TRUE(first.setup({}));
  for (std::int64_t index = 0; index < 10; ++index) ASSERT_TRUE(first.element(numbered_element(index)));
  ASSERT_TRUE(eventually([&] { return database_.ask("SELECT count(*) FROM marble_elements") == "10"; }));
  std::string id;
  const grpc::Status status = submit_array(b->jobs(), {}, elements_of(40), &id);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
  EXPECT_THAT(status.error_message(), HasSubstr("client_bytes"));
  first.cancel();
  EXPECT_TRUE(eventually([&] { return submit_array(b->jobs(), {}, elements_of(10), &id).ok(); }));
  expect_numbered(ArrayReader(a->jobs(), id).drain(), 10);
  EXPECT_TRUE(
      eventually([&] { return database_.ask("SELECT sum(bytes) FROM marble_jobs WHERE state < 3") == "0"; }));
}

TEST_F(FleetArrays, ExpiresWithItsAnswersOnAllServers) {
  const auto a = start({"--result-keep-s", "1"}), b = start({"--result-keep-s", "1"});
  const std::string id = submit_array(a->jobs(), elements_of(5));
  EXPECT_TRUE(eventually_gone(*b, id));
  EXPECT_TRUE(eventually_gone(*a, id));
  EXPECT_TRUE(eventually([&] { return database_.ask("SELECT count(*) FROM marble_elements") == "0"; }));
}

// Servers and the database are killed at any moment, and servers restarted; the reader asks any server.
TEST_F(FleetArrays, EachElementIsAnsweredOnceWhateverIsKilled) {
  constexpr int kElements = 600;
  std::mt19937 random(23);
  const std::vector<std::string> with = flags({"--workers", "2", "--job-starts", "1000"});
  std::vector<std::unique_ptr<Node>> nodes;
  for (int i = 0; i < 3; ++i) nodes.push_back(std::make_unique<Node>(with));
  const std::string id = submit_array(nodes[0]->jobs(), elements_of(kElements));
  std::vector<v1::ArrayResultsResponse> received;
  for (int round = 0; received.size() < kElements; ++round) {
    const std::size_t enough = received.size() + 1 + random() % 150;
    {
      Node& read = *nodes[random() % nodes.size()];
      ArrayReader reader(read.jobs(), id, received.empty() ? 0 : received.back().sequence());
      while (received.size() < enough) {
        auto answer = reader.next();
        if (!answer) break;
        received.push_back(std::move(*answer));
      }
    }
    if (received.size() >= kElements) break;
    if (round % 4 == 3) {
      database_.kill();
      database_.start();
      continue;
    }
    std::unique_ptr<Node>& victim = nodes[random() % nodes.size()];
    victim->kill();
    victim = nullptr;
    const std::string moments[] = {"before_commit", "after_commit", "before_answer", "none"};
    while (victim == nullptr)
      victim = faulty_node(with, moments[random() % 4] + ":" + std::to_string(20 + random() % 100));
    for (auto& node : nodes) {  // those that fell at such a moment
      if (!node->server().running()) node = std::make_unique<Node>(with);
    }
  }
  expect_numbered(received, kElements);
  EXPECT_EQ(database_.ask("SELECT count(DISTINCT sequence) FROM marble_elements"), std::to_string(kElements));
}

}  // namespace
}  // namespace marble::testing
