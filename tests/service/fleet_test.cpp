// --state: several servers share a store. Submitted anywhere, run anywhere, answered for everywhere, once.
#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include "fleet_node.h"
#include "marble/convert.h"
#include "marble/convert_coupled.h"
#include "marble/convert_scenarios.h"
#include "marble/scenario_examples.h"
#include "support/coupled_problems.h"
#include "support/postgres_process.h"

namespace marble::testing {
namespace {

class Fleet : public ::testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<Node> start(std::vector<std::string> flags = {}) {
    for (const char* flag : {"--workers", "--state-lease-s"}) {
      if (std::ranges::find(flags, flag) == flags.end()) flags.insert(flags.end(), {flag, "1"});
    }
    flags.insert(flags.end(), {"--state", database_.uri()});
    return std::make_unique<Node>(flags);
  }
  static bool eventually_is(Node& node, const std::string& id, v1::JobState state) {
    return eventually([&] { return node.job(id).state() == state; });
  }
  /// Keeps its only worker busy until it is cancelled.
  static std::string occupy(Node& node) {
    const std::string id = node.submit(long_request());
    EXPECT_TRUE(eventually_is(node, id, v1::JOB_STATE_RUNNING));
    return id;
  }

  /// A server that must not start, and must say `why`, but not `secret`; its exit status.
  static int refused(std::vector<std::string> flags, const std::string& why, const std::string& secret = "") {
    TemporaryDirectory directory;
    flags.insert(flags.begin(), {MARBLE_SERVER_BINARY, "--listen", "127.0.0.1:0", "--http", "none"});
    ChildProcess process(flags, directory.file("output"));
    const int code = process.wait();
    EXPECT_NE(process.output().find(why), std::string::npos) << process.output();
    EXPECT_TRUE(secret.empty() || process.output().find(secret) == std::string::npos) << process.output();
    return code;
  }

  PostgresProcess database_{MARBLE_POSTGRES_DIR};
};

TEST_F(Fleet, AnyServerAnswersForAnyJob) {
  const auto a = start(), b = start();
  const std::string quick = a->submit(numbered(5));
  expect_answer(*b, quick, 5);
  expect_answer(*a, quick, 5);
  const v1::GetJobResponse here = a->get(quick), there = b->get(quick);
  EXPECT_EQ(here.job().state(), v1::JOB_STATE_FINISHED);
  EXPECT_FALSE(here.job().server().empty());
  EXPECT_EQ(here.job().server(), there.job().server());
  EXPECT_GT(here.trace().rows_size(), 0);
  EXPECT_EQ(here.trace().DebugString(), there.trace().DebugString());
  EXPECT_EQ(here.options().DebugString(), there.options().DebugString());
  EXPECT_TRUE(a->list().contains(quick));
  EXPECT_TRUE(b->list().contains(quick));
  EXPECT_TRUE(b->remove(quick).ok());
  a->get(quick, grpc::StatusCode::NOT_FOUND);
  v1::SolveResponse response;
  EXPECT_EQ(a->result(quick, true, &response).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(Fleet, AnyServerAnswersOverPlainHttpToo) {
  const auto a = start({"--http", "127.0.0.1:0"}), b = start({"--http", "127.0.0.1:0"});
  httplib::Client here(a->server().http()), there(b->server().http());
  there.set_read_timeout(120);
  const auto taken =
      here.Post("/api/jobs", R"({"problem": {"n": 1, "g": [1], "d": [2], "C": {"rows": 1, "cols": 1,
    "i": [0], "j": [0], "v": [1]}}, "request_id": "one"})",
                "application/json");
  ASSERT_EQ(taken->status, 202) << taken->body;
  const std::string path = taken->get_header_value("Location");
  const auto answer = there.Get(path + "/result?wait=60");
  ASSERT_EQ(answer->status, 200) << answer->body;
  EXPECT_NE(answer->body.find("\"objective\":-2"), std::string::npos) << answer->body;
  EXPECT_EQ(here.Get(path + "/result")->body, answer->body);
  EXPECT_EQ(there.Delete(path)->status, 200);
  EXPECT_EQ(here.Get(path + "/result")->status, 404);
}

TEST_F(Fleet, AJobIsEndedFromAnotherServerWhetherItRunsOrWaits) {
  const auto a = start(), b = start();
  const std::string first = occupy(*a), second = occupy(*b);
  EXPECT_NE(a->job(first).server(), a->job(second).server()) << "each took one";
  const std::string waiting = a->submit(numbered(1));
  EXPECT_EQ(b->job(waiting).state(), v1::JOB_STATE_QUEUED);
  v1::CancelJobResponse reported;
  EXPECT_TRUE(b->cancel(waiting, &reported).ok());
  EXPECT_EQ(reported.job().state(), v1::JOB_STATE_FINISHED);
  EXPECT_EQ(a->job(waiting).state(), v1::JOB_STATE_FINISHED);
  v1::SolveResponse response;
  EXPECT_EQ(a->result(waiting, true, &response).error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(b->cancel(first).ok());
  EXPECT_TRUE(a->cancel(second).ok());
  for (const std::string& id : {first, second}) {
    EXPECT_TRUE(b->result(id, true, &response).ok());
    EXPECT_EQ(response.solution().status(), v1::STATUS_CANCELLED);
  }
  const std::string deleted = occupy(*a);
  EXPECT_TRUE(b->remove(deleted).ok());
  EXPECT_TRUE(eventually([&] { return a->solves() && b->solves(); })) << "its worker is free again";
}

TEST_F(Fleet, WhoWatchesOnAnotherServerSeesTheRowsAndTheEnd) {
  const auto a = start();
  const std::string id = occupy(*a);
  const auto b = start();
  grpc::ClientContext context;
  v1::WatchJobsRequest request;
  request.set_job_id(id);
  const auto events = b->jobs().Watch(&context, request);
  v1::WatchJobsResponse event;
  std::int64_t rows = 0;
  while (rows < 200 && events->Read(&event)) {
    for (const v1::JobEvent& one : event.events()) rows += one.rows_size();
  }
  EXPECT_GE(rows, 200);
  EXPECT_GT(b->job(id).iterations(), 0);
  EXPECT_GT(b->get(id).trace().rows_size(), 10);
  EXPECT_TRUE(a->cancel(id).ok());
  v1::JobInfo last;
  while (events->Read(&event)) last = event.events().rbegin()->job();
  EXPECT_TRUE(events->Finish().ok());
  EXPECT_EQ(last.state(), v1::JOB_STATE_FINISHED);
}

TEST_F(Fleet, ARequestIdIsOneJobWhicheverServerIsAsked) {
  const auto a = start(), b = start();
  const std::string id = a->submit(numbered(1));
  EXPECT_EQ(b->submit(numbered(1)), id);
  v1::SolveRequest other = numbered(2);
  other.set_request_id("r1");
  std::string unused;
  const grpc::Status status = b->submit(other, &unused);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
  EXPECT_EQ(bad_field(status).field(), "request_id");
  EXPECT_TRUE(a->remove(id).ok());
  EXPECT_NE(b->submit(numbered(1)), id) << "deleted is forgotten";
}

TEST_F(Fleet, PrioritiesAndTurnsHoldForAllServers) {
  const auto a = start({"--starvation-limit-s", "1000"}), b = start({"--starvation-limit-s", "1000"});
  const std::string first = occupy(*a), second = occupy(*b);
  const auto submit = [&](Node& node, const char* client, v1::Priority priority) {
    grpc::ClientContext context;
    context.AddMetadata("marble-client", client);
    v1::SolveRequest request = example_request();
    request.set_priority(priority);
    v1::SubmitResponse response;
    const grpc::Status status = node.jobs().Submit(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.job_id();
  };
  std::vector<std::string> ids;
  ids.push_back(submit(*a, "x", v1::PRIORITY_BATCH));
  for (int i = 0; i < 3; ++i) ids.push_back(submit(*b, "x", v1::PRIORITY_INTERACTIVE));
  ids.push_back(submit(*a, "y", v1::PRIORITY_INTERACTIVE));
  ids.push_back(submit(*b, "z", v1::PRIORITY_REALTIME));
  EXPECT_EQ(a->job(ids[0]).queue_position(), 5);
  EXPECT_TRUE(a->cancel(first).ok());
  std::vector<std::pair<double, std::size_t>> ends;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    v1::SolveResponse response;
    EXPECT_TRUE(b->result(ids[i], true, &response).ok());
    ends.emplace_back(b->job(ids[i]).finished_unix_s(), i);
  }
  std::ranges::sort(ends);
  std::vector<std::size_t> order;
  for (const auto& [end, number] : ends) order.push_back(number);
  EXPECT_EQ(order, (std::vector<std::size_t>{5, 1, 4, 2, 3, 0})) << "z, x, y, x, x, x";
  EXPECT_TRUE(b->cancel(second).ok());
}

TEST_F(Fleet, BoundsHoldForAllServersTogether) {
  const std::vector<std::string> flags = {"--queue-jobs", "2", "--client-queued", "2"};
  const auto a = start(flags), b = start(flags);
  const std::string first = occupy(*a), second = occupy(*b);
  (void)a->submit(example_request());
  (void)b->submit(example_request());
  for (Node* node : {a.get(), b.get()}) {
    std::string id;
    const grpc::Status status = node->submit(example_request(), &id);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
    EXPECT_NE(status.error_message().find("client_queued"), std::string::npos) << status.error_message();
    EXPECT_TRUE(retry_info(status).has_value());
  }
  EXPECT_TRUE(a->cancel(first).ok());
  EXPECT_TRUE(b->cancel(second).ok());
}

TEST_F(Fleet, AKilledServersJobIsTakenOverAndAnsweredOnce) {
  auto a = start();
  const std::string id = occupy(*a);
  const std::string before = a->job(id).server();
  const auto b = start();
  EXPECT_EQ(b->job(id).server(), before);
  a->kill();
  ASSERT_TRUE(eventually([&] {
    const v1::JobInfo job = b->job(id);
    return job.state() == v1::JOB_STATE_RUNNING && job.server() != before;
  })) << b->server().log();
  EXPECT_EQ(b->server().log_lines({"job_taken_over", id}).size(), 1U);
  EXPECT_TRUE(b->cancel(id).ok());
  v1::SolveResponse response;
  EXPECT_TRUE(b->result(id, true, &response).ok());
  EXPECT_EQ(database_.ask("SELECT count(*) FROM marble_answers"), "1");
}

TEST_F(Fleet, AServerThatStopsGivesItsJobsBackAtOnce) {
  auto a = start({"--drain-grace-s", "0", "--state-lease-s", "3600"});
  const std::string id = occupy(*a);
  const std::string before = a->job(id).server();
  const auto b = start({"--state-lease-s", "3600"});
  a->stop();
  ASSERT_TRUE(eventually([&] { return b->job(id).server() != before; }));
  ASSERT_TRUE(eventually_is(*b, id, v1::JOB_STATE_RUNNING));
  EXPECT_TRUE(b->cancel(id).ok());
}

// The server that others thought dead goes on; what it makes of the job is not taken.
TEST_F(Fleet, OnlyWhoHoldsTheJobMayAnswerIt) {
  const auto a = start();
  const std::string id = occupy(*a);
  const std::string before = a->job(id).server();
  const auto b = start();
  a->server().send(SIGSTOP);
  ASSERT_TRUE(eventually([&] {
    const v1::JobInfo job = b->job(id);
    return job.state() == v1::JOB_STATE_RUNNING && job.server() != before;
  }));
  a->server().send(SIGCONT);
  ASSERT_TRUE(eventually([&] { return a->solves(); })) << "it lets go of it";
  EXPECT_EQ(a->job(id).server(), b->job(id).server());
  EXPECT_EQ(a->job(id).state(), v1::JOB_STATE_RUNNING);
  EXPECT_TRUE(a->cancel(id).ok());
  v1::SolveResponse here, there;
  EXPECT_TRUE(a->result(id, true, &here).ok());
  EXPECT_TRUE(b->result(id, true, &there).ok());
  EXPECT_EQ(here.SerializeAsString(), there.SerializeAsString());
}

// As if another had taken it over, and had gone away with it too.
TEST_F(Fleet, AJobThatComesBackToWhoLostItBeginsAnew) {
  const auto a = start({"--state-lease-s", "3600"});
  const std::string id = occupy(*a);
  (void)database_.ask(
      "UPDATE marble_jobs SET state = 0, token = '', lease = NULL, lost = lost + 1,"
      " changed = pg_current_xact_id(); NOTIFY marble_jobs");
  ASSERT_TRUE(eventually([&] { return a->counters().cancelled_total() == 1; })) << "the run that was lost";
  ASSERT_TRUE(eventually_is(*a, id, v1::JOB_STATE_RUNNING));
  EXPECT_EQ(database_.ask("SELECT count(*) FROM marble_answers"), "0") << "nobody has cancelled it";
  EXPECT_TRUE(a->list().contains(id));
  EXPECT_TRUE(a->cancel(id).ok());
  v1::SolveResponse response;
  EXPECT_TRUE(a->result(id, true, &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_CANCELLED);
  EXPECT_EQ(a->job(id).state(), v1::JOB_STATE_FINISHED);
}

TEST_F(Fleet, WithoutTheStoreEverythingElseGoesOn) {
  const auto a = start({"--http", "127.0.0.1:0"});
  expect_answer(*a, a->submit(numbered(1)), 1);
  EXPECT_EQ(a->ready(), "200 ready\n");
  const std::string running = occupy(*a);
  for (const bool killed : {true, false}) {
    if (killed) {
      database_.kill();
    } else {
      database_.stop();
    }
    std::string id;
    grpc::Status refused;
    ASSERT_TRUE(eventually([&] { return !(refused = a->submit(numbered(2), &id)).ok(); }));
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::UNAVAILABLE) << refused.error_message();
    EXPECT_TRUE(retry_info(refused).has_value());
    ASSERT_TRUE(eventually([&] { return a->ready() != "200 ready\n"; }));
    EXPECT_EQ(a->ready().rfind("200 ready, but no job can be submitted: ", 0), 0U) << a->ready();
    EXPECT_EQ(a->job(running).state(), v1::JOB_STATE_RUNNING) << "what is known is reported";
    a->get("never heard of", grpc::StatusCode::UNAVAILABLE);
    database_.start();
    ASSERT_TRUE(eventually([&] { return a->submit(numbered(killed ? 3 : 4), &id).ok(); }));
    EXPECT_EQ(a->ready(), "200 ready\n");
  }
  EXPECT_TRUE(a->cancel(running).ok());
  v1::SolveResponse response;
  EXPECT_TRUE(a->result(running, true, &response).ok()) << "it ran on";
  expect_answer(*a, a->submit(numbered(3)), 3);
  expect_answer(*a, a->submit(numbered(4)), 4);
  a->get("never heard of", grpc::StatusCode::NOT_FOUND);
}

TEST_F(Fleet, AServerStartsWithoutTheStoreAndFindsItLater) {
  database_.stop();
  const auto a = start();
  EXPECT_TRUE(a->solves());
  database_.start();
  std::string id;
  ASSERT_TRUE(eventually([&] { return a->submit(numbered(1), &id).ok(); }));
  expect_answer(*a, id, 1);
}

TEST_F(Fleet, JobsAndAnswersOutliveAllServers) {
  std::string done, waiting;
  v1::SolveResponse before, after;
  {
    auto a = start();
    done = a->submit(numbered(1));
    ASSERT_TRUE(a->result(done, true, &before).ok());
    (void)occupy(*a);
    waiting = a->submit(numbered(2));
    a->kill();
  }
  const auto b = start({"--workers", "2"});
  ASSERT_TRUE(b->result(done, true, &after).ok());
  EXPECT_EQ(after.SerializeAsString(), before.SerializeAsString());
  EXPECT_GT(b->get(done).trace().rows_size(), 0);
  expect_answer(*b, waiting, 2);
}

TEST_F(Fleet, WhatAnAnswerSaysBesidesItsPlanIsThereOnEveryServerToTheLastByte) {
  const OwnedCoupled cell = random_coupled({.blocks = 3}, 7);
  v1::SolveRequest tied, scenarios;
  to_message(cell.view(), tied.mutable_coupled());
  const examples::OneNumberScenarios rocket = examples::rocket_by_altitude();
  const ScenarioProblem problem = rocket.scenarios(std::vector<double>{3.0, 3.5, 4.0});
  to_message(problem.base, scenarios.mutable_problem());
  ASSERT_TRUE(to_message(problem, problem.scenarios, scenarios.mutable_scenarios()));
  auto a = start(), b = start();
  const std::string of_blocks = a->submit(tied), of_scenarios = b->submit(scenarios);
  std::map<std::string, std::string> reported;
  for (const std::string& id : {of_blocks, of_scenarios}) {
    v1::SolveResponse here, there;
    ASSERT_TRUE(a->result(id, true, &here).ok());
    ASSERT_TRUE(b->result(id, true, &there).ok());
    EXPECT_EQ(here.solution().has_coupled(), id == of_blocks);
    EXPECT_EQ(here.solution().has_scenarios(), id == of_scenarios);
    EXPECT_EQ(here.SerializeAsString(), there.SerializeAsString());
    reported[id] = here.SerializeAsString();
    EXPECT_EQ(a->get(id).DebugString(), b->get(id).DebugString());
  }
  a->kill();
  b->stop();
  const auto later = start();
  for (const auto& [id, bytes] : reported) {
    v1::SolveResponse response;
    ASSERT_TRUE(later->result(id, true, &response).ok());
    EXPECT_EQ(response.SerializeAsString(), bytes);
  }
}

TEST_F(Fleet, AnswersGoAfterTheirTimeOnAllServers) {
  const auto a = start({"--result-keep-s", "1"}), b = start({"--result-keep-s", "1"});
  const std::string id = a->submit(numbered(1));
  EXPECT_TRUE(eventually([&] {
    v1::SolveResponse response;
    return b->result(id, true, &response).error_code() == grpc::StatusCode::NOT_FOUND;
  }));
}

TEST_F(Fleet, TablesOfAnotherVersionAreRefusedInWords) {
  start().reset();
  EXPECT_EQ(
      refused({"--state", database_.uri(), "--check-state"}, "ok, 0 jobs without an answer, 0 with one"), 0);
  (void)database_.ask("UPDATE marble_schema SET version = 7");
  EXPECT_EQ(refused({"--state", database_.uri()}, "is of version 7, this server knows 2"), 2);
  EXPECT_EQ(refused({"--state", database_.uri(), "--check-state"}, "is of version 7"), 2);
}

TEST_F(Fleet, AnAddressThatReportsASecretIsRefusedAndNotRepeated) {
  for (const auto& [address, why] :
       {std::pair("mysql://x:secret@y", "must begin with postgresql://"),
        std::pair("postgresql://x:secret@y/z", "must hold no password"),
        std::pair("postgresql://x@y/z?pass%77ord=secret", "must hold no password"),
        std::pair("postgresql://x@y/z?sslpassword=secret", "must hold no sslpassword"),
        std::pair("postgresql://y/z?secret=1", "is no address of PostgreSQL")})
    EXPECT_EQ(refused({"--state", address}, why, "secret"), 2);
  EXPECT_EQ(refused({"--state", database_.uri(), "--state-dir", "/nowhere"}, "beside state_dir"), 2);
}

TEST_F(Fleet, AMissingLibraryIsReportedWithThePackageThatHasIt) {
  TemporaryDirectory directory;
  std::ofstream(directory.file("libpq.so.5")).put('?');  // found first, and no library
  setenv("LD_LIBRARY_PATH", std::filesystem::path(directory.file("x")).parent_path().c_str(), 1);
  EXPECT_EQ(refused({"--state", database_.uri()}, "libpq5"), 2);
  unsetenv("LD_LIBRARY_PATH");
}

// Servers and the database are killed at any moment, and servers restarted; clients ask any server that
// answers.
TEST_F(Fleet, EachAcceptedJobIsAnsweredOnceWhateverIsKilled) {
  constexpr int kRounds = 4, kJobs = 40;
  std::mt19937 random(11);
  std::vector<std::unique_ptr<Node>> nodes;
  const std::vector<std::string> flags = {"--job-starts", "1000"};  // the kills are no job's fault
  for (int i = 0; i < 3; ++i) nodes.push_back(start(flags));
  std::map<int, std::string> accepted;
  int number = 0;
  for (int round = 0; round < kRounds; ++round) {
    const std::size_t victim = random() % nodes.size();
    const int moment = number + static_cast<int>(random() % kJobs);
    for (const int end = number + kJobs; number < end; ++number) {
      if (number == moment && round % 2 == 0) nodes[victim]->kill();
      if (number == moment && round % 2 == 1) database_.kill(), database_.start();
      std::string id;
      std::size_t at = random() % nodes.size();
      ASSERT_TRUE(eventually([&] { return nodes[at++ % nodes.size()]->submit(numbered(number), &id).ok(); }));
      accepted[number] = id;
    }
    if (round % 2 == 0) nodes[victim] = start(flags);
  }
  std::set<std::string> ids;
  for (const auto& [job, id] : accepted) {
    expect_answer(*nodes[random() % nodes.size()], id, job);
    ids.insert(id);
  }
  EXPECT_EQ(ids.size(), accepted.size());
  EXPECT_EQ(database_.ask("SELECT count(*) FROM marble_answers"), std::to_string(accepted.size()));
  EXPECT_EQ(database_.ask("SELECT count(*) FROM marble_jobs WHERE state <> 2"), "0");
}

}  // namespace
}  // namespace marble::testing
