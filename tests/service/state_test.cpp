// --state-dir: accepted means kept. Jobs and answers outlive a kill, a stop, and a disk that was full for a
// while.
#include <httplib.h>
#include <sys/resource.h>

#include <fstream>
#include <random>
#include <set>

#include "jobs_client.h"

namespace marble::testing {
namespace {

class State : public JobsServiceTest {
 protected:
  void start(std::vector<std::string> flags = {}) {
    flags.insert(flags.end(), {"--state-dir", directory_.file("state")});
    JobsServiceTest::start(flags);
  }
  void kill_it() {
    server().send(SIGKILL);
    EXPECT_EQ(server().wait(), -SIGKILL);
  }
  v1::JobState state_of(const std::string& id) { return get(id).job().state(); }
  /// Runs the server to its end; for what must not start.
  int refused(const std::string& text, std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), {MARBLE_SERVER_BINARY, "--listen", "127.0.0.1:0", "--http", "none",
                                 "--state-dir", directory_.file("state")});
    ChildProcess process(flags, directory_.file("output"), {});
    const int code = process.wait();
    EXPECT_NE(process.output().find(text), std::string::npos) << process.output();
    return code;
  }

  static constexpr rlim_t kFull = 32768;  // less than the store's log has by then, more than the server's
  TemporaryDirectory directory_;
};

TEST_F(State, JobsWithoutAnAnswerRunAgainAfterAKillInTheirOrder) {
  start({"--workers", "1"});
  const std::string running = submit(long_request());
  ASSERT_TRUE(eventually([&] { return state_of(running) == v1::JOB_STATE_RUNNING; }));
  v1::SolveRequest patient = example_request();
  patient.set_priority(v1::PRIORITY_BATCH);
  const std::string last = submit(patient);
  const std::string first = submit(example_request());
  const std::string second = submit(example_request());
  const double accepted = get(first).job().accepted_unix_s();
  kill_it();
  start({"--workers", "1"});
  ASSERT_TRUE(eventually([&] { return state_of(running) == v1::JOB_STATE_RUNNING; }));
  const auto places = [&] {
    std::vector<int> at;
    for (const std::string& id : {first, second, last}) at.push_back(get(id).job().queue_position());
    return at;
  };
  EXPECT_TRUE(eventually([&] {
    return places() == std::vector<int>{0, 1, 2};
  })) << ::testing::PrintToString(places());
  EXPECT_NEAR(get(first).job().accepted_unix_s(), accepted, 1e-3);
  EXPECT_TRUE(cancel(running).ok());
  for (const std::string& id : {first, second, last}) {
    v1::SolveResponse response;
    ASSERT_TRUE(result(id, true, &response).ok());
    EXPECT_EQ(response.job_id(), id);
    EXPECT_NEAR(response.solution().objective(), 3.0, 1e-9);
  }
}

TEST_F(State, AnswersOutliveAKillToTheLastByteWithTheirTraces) {
  start();
  v1::SolveRequest named = long_request(50);
  named.set_request_id("mine");
  const std::string id = submit(named);
  v1::SolveResponse before, after;
  ASSERT_TRUE(result(id, true, &before).ok());
  const v1::GetJobResponse job = get(id);
  v1::SolveRequest hopeless = example_request();
  hopeless.mutable_options()->set_max_iterations(1);
  const std::string other = submit(hopeless);
  v1::SolveResponse unused;
  ASSERT_TRUE(result(other, true, &unused).ok());
  kill_it();
  start();
  ASSERT_TRUE(result(id, true, &after).ok());
  EXPECT_EQ(after.SerializeAsString(), before.SerializeAsString());
  EXPECT_EQ(get(id).DebugString(), job.DebugString());
  EXPECT_GT(get(id).trace().rows_size(), 10);
}

TEST_F(State, CancelledStaysCancelledAndDeletedDeleted) {
  start({"--workers", "1"});
  const std::string running = submit(long_request());
  ASSERT_TRUE(eventually([&] { return state_of(running) == v1::JOB_STATE_RUNNING; }));
  const std::string given_up = submit(example_request());
  const std::string gone = submit(example_request());
  EXPECT_TRUE(cancel(given_up).ok());
  EXPECT_TRUE(remove(gone).ok());
  EXPECT_TRUE(cancel(running).ok());
  kill_it();
  start({"--workers", "1"});
  v1::SolveResponse response;
  EXPECT_EQ(result(given_up, true, &response).error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(result(gone, true, &response).error_code(), grpc::StatusCode::NOT_FOUND);
  // Killed before or after its best iterate was on disk: in neither case it runs.
  const grpc::Status ended = result(running, true, &response);
  EXPECT_TRUE(ended.error_code() == grpc::StatusCode::CANCELLED ||
              response.solution().status() == v1::STATUS_CANCELLED)
      << ended.error_message();
  EXPECT_EQ(counters().running(), 0);
}

TEST_F(State, WhatAStopInterruptsBeginsAgain) {
  start({"--workers", "1", "--drain-grace-s", "0"});
  const std::string running = submit(long_request());
  ASSERT_TRUE(eventually([&] { return state_of(running) == v1::JOB_STATE_RUNNING; }));
  const std::string waiting = submit(example_request());
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
  start({"--workers", "1"});
  ASSERT_TRUE(eventually([&] { return state_of(running) == v1::JOB_STATE_RUNNING; }));
  EXPECT_EQ(state_of(waiting), v1::JOB_STATE_QUEUED);
  EXPECT_TRUE(cancel(running).ok());
  v1::SolveResponse response;
  ASSERT_TRUE(result(waiting, true, &response).ok());
}

TEST_F(State, ARequestIdIsOneJobAfterARestartToo) {
  start();
  v1::SolveRequest request = example_request();
  request.set_request_id("mine");
  const std::string id = submit(request);
  EXPECT_EQ(submit(request), id);
  kill_it();
  start();
  EXPECT_EQ(submit(request), id);
  request.mutable_options()->set_max_iterations(7);
  std::string other;
  const grpc::Status status = submit(request, &other);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(status).field(), "request_id");
  EXPECT_NE(status.error_message().find(id), std::string::npos) << status.error_message();
}

TEST_F(State, WithLowerLimitsThanBeforeJobsWaitForRoom) {
  start({"--workers", "1"});
  const std::string running = submit(long_request());
  ASSERT_TRUE(eventually([&] { return state_of(running) == v1::JOB_STATE_RUNNING; }));
  std::vector<std::string> ids;
  for (int i = 0; i < 5; ++i) ids.push_back(submit(example_request()));
  kill_it();
  start({"--workers", "1", "--queue-jobs", "1"});
  ASSERT_TRUE(eventually([&] { return state_of(running) == v1::JOB_STATE_RUNNING; }));
  EXPECT_TRUE(cancel(running).ok());
  for (const std::string& id : ids) {
    v1::SolveResponse response;
    EXPECT_TRUE(result(id, true, &response).ok()) << id;
  }
}

// The limit of a file's size stands for a disk that is full: the same errors, on any machine.
TEST_F(State, AFullDiskRefusesJobsAndNothingElse) {
  start({"--http", "127.0.0.1:0"});
  const std::string before = submit(example_request());
  v1::SolveResponse response;
  ASSERT_TRUE(result(before, true, &response).ok());
  const auto reported = [&](const char* value) {
    const auto metrics = httplib::Client(server().http()).Get("/metrics");
    return metrics &&
           metrics->body.find("\nmarble_state_written " + std::string(value) + "\n") != std::string::npos;
  };
  EXPECT_TRUE(reported("1"));
  rlimit unlimited = {};
  ASSERT_EQ(prlimit(server().pid(), RLIMIT_FSIZE, nullptr, &unlimited), 0);
  const rlimit full = {kFull, unlimited.rlim_max};
  ASSERT_EQ(prlimit(server().pid(), RLIMIT_FSIZE, &full, nullptr), 0);
  std::string id;
  const grpc::Status refused = submit(example_request(), &id);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::UNAVAILABLE) << refused.error_message();
  EXPECT_NE(refused.error_message().find("cannot keep"), std::string::npos) << refused.error_message();
  EXPECT_TRUE(lives());
  EXPECT_TRUE(result(before, true, &response).ok());
  EXPECT_TRUE(eventually([&] { return !server().log_lines({"state_not_written"}).empty(); }))
      << server().log();
  EXPECT_TRUE(reported("0"));
  ASSERT_EQ(prlimit(server().pid(), RLIMIT_FSIZE, &unlimited, nullptr), 0);
  ASSERT_TRUE(eventually([&] { return submit(example_request(), &id).ok(); }));
  EXPECT_TRUE(result(id, true, &response).ok());
  EXPECT_TRUE(reported("1"));
  kill_it();
  start();
  EXPECT_TRUE(result(before, true, &response).ok());
  EXPECT_TRUE(result(id, true, &response).ok());
}

TEST_F(State, AJobThatEndsWhileTheDiskIsFullHasItsAnswer) {
  start({"--workers", "1"});
  const std::string running = submit(long_request());
  ASSERT_TRUE(eventually([&] { return state_of(running) == v1::JOB_STATE_RUNNING; }));
  rlimit unlimited = {};
  ASSERT_EQ(prlimit(server().pid(), RLIMIT_FSIZE, nullptr, &unlimited), 0);
  const rlimit full = {kFull, unlimited.rlim_max};
  ASSERT_EQ(prlimit(server().pid(), RLIMIT_FSIZE, &full, nullptr), 0);
  const grpc::Status reported = cancel(running);  // ends; that it was asked to cannot be stored yet
  EXPECT_EQ(reported.error_code(), grpc::StatusCode::UNAVAILABLE) << reported.error_message();
  v1::SolveResponse response;
  ASSERT_TRUE(result(running, true, &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_CANCELLED);
  ASSERT_EQ(prlimit(server().pid(), RLIMIT_FSIZE, &unlimited, nullptr), 0);
  ASSERT_TRUE(eventually([&] { return !server().log_lines({"state_written_again"}).empty(); }));
  kill_it();
  start();
  v1::SolveResponse after;
  ASSERT_TRUE(result(running, true, &after).ok());
  EXPECT_EQ(after.SerializeAsString(), response.SerializeAsString());
}

TEST_F(State, ADirectoryThatCannotBeUsedIsRefusedInWords) {
  std::filesystem::create_directory(directory_.file("place"));
  start();
  EXPECT_EQ(refused("another server uses it"), 2);
  kill_it();
  const std::string file = directory_.file("state") + "/jobs.sqlite";
  for (const char* leftover : {"-wal", "-shm"}) std::filesystem::remove(file + leftover);
  std::ofstream(file, std::ios::trunc) << std::string(5000, 'x');
  EXPECT_EQ(refused("file is not a database"), 2);
  EXPECT_EQ(refused("file is not a database", {"--check-state"}), 2);
  std::filesystem::remove(file);
  start();
}

TEST_F(State, IsLookedThroughWhileTheServerRuns) {
  start({"--workers", "1"});
  const std::string done = submit(example_request());
  v1::SolveResponse response;
  ASSERT_TRUE(result(done, true, &response).ok());
  (void)submit(long_request());
  EXPECT_EQ(refused("ok, 1 jobs without an answer, 1 with one", {"--check-state"}), 0);
}

// At any moment: in the middle of a transaction, between a commit and its answer, while answers are written.
TEST_F(State, NoAcceptedJobIsLostWheneverTheServerIsKilled) {
  constexpr int kRounds = 6;
  const std::vector<std::string> flags = {"--job-starts", "1000"};  // the kills are no job's fault
  std::mt19937 random(17);
  std::set<std::string> accepted;
  start(flags);
  for (int round = 0; round < kRounds; ++round) {
    const std::size_t enough = accepted.size() + 1 + random() % 40;
    std::thread killer;
    while (true) {
      v1::SolveRequest request = example_request();
      request.mutable_problem()->set_constant(static_cast<double>(accepted.size()));
      request.set_request_id(std::to_string(accepted.size()));
      std::string id;
      if (!submit(request, &id).ok()) break;
      accepted.insert(id);
      if (accepted.size() == enough) killer = std::thread([this] { server().send(SIGKILL); });
    }
    killer.join();
    EXPECT_EQ(server().wait(), -SIGKILL);
    start(flags);
  }
  std::set<double> objectives;
  for (const std::string& id : accepted) {
    v1::SolveResponse response;
    const grpc::Status status = result(id, true, &response);
    ASSERT_TRUE(status.ok()) << id << ": " << status.error_message();
    objectives.insert(std::round(response.solution().objective() - 3.0));
  }
  EXPECT_EQ(objectives.size(), accepted.size()) << "each its own answer";
  EXPECT_EQ(*objectives.rbegin(), static_cast<double>(accepted.size() - 1));
}

}  // namespace
}  // namespace marble::testing
