#include "marble/convert.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "service_test.h"

namespace marble::testing {
namespace {

// Solve: one problem, one answer.
class Solve : public ServiceTest {};

TEST_F(Solve, AnswersWithTheOptimum) {
  start();
  v1::SolveResponse response;
  const grpc::Status status = solve(example_request(), &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  const v1::Solution& solution = response.solution();
  EXPECT_EQ(solution.status(), v1::STATUS_SOLVED);
  EXPECT_NEAR(solution.objective(), 3.0, 1e-4);
  ASSERT_EQ(solution.z_size(), 4);
  EXPECT_NEAR(solution.z(0), 1.0, 1e-4);
  EXPECT_EQ(solution.equality_multipliers_size(), 1);
  EXPECT_EQ(solution.inequality_multipliers_size(), 1);
  EXPECT_EQ(solution.complementarity_multipliers_l_size(), 1);
  EXPECT_EQ(solution.complementarity_multipliers_r_size(), 1);
  EXPECT_LE(solution.violations().complementarity(), 1e-6);
  EXPECT_FALSE(response.job_id().empty());
  EXPECT_GE(solution.times().total_s(), solution.times().queue_s());
}

TEST_F(Solve, GivesTheSameBitsAsTheLibraryInProcess) {
  start();
  const v1::SolveRequest request = long_request(50);
  v1::SolveResponse remote;
  ASSERT_TRUE(solve(request, &remote).ok());
  const auto problem = Problem::create(view_of(request.problem()));
  ASSERT_TRUE(problem.has_value());
  auto solver = Solver::create(*problem, options_of(request.options()).value());
  const Solution local = solver->solve().value();
  EXPECT_EQ(solution_of(remote.solution()).z, local.z);
  EXPECT_EQ(solution_of(remote.solution()).equality_multipliers, local.equality_multipliers);
  EXPECT_EQ(remote.solution().objective(), local.objective);
}

TEST_F(Solve, StartsAtTheInitialPoint) {
  start();
  v1::SolveRequest request = example_request();
  request.mutable_options()->set_max_iterations(0);
  for (const double z : {1.0, 4.0, 0.0, 1.0}) request.mutable_initial_point()->add_z(z);
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_ITERATION_LIMIT);
  ASSERT_EQ(response.solution().z_size(), 4);
  EXPECT_NEAR(response.solution().z(1), 4.0, 1e-12);
}

TEST_F(Solve, ReportsTheOptionsThatWereUsedDefaultsIncluded) {
  start();
  v1::SolveRequest request = example_request();
  request.mutable_options()->set_equality_tolerance(1e-8);
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  EXPECT_EQ(response.solution().options().equality_tolerance(), 1e-8);
  EXPECT_EQ(response.solution().options().inequality_tolerance(), Options().inequality_tolerance);
  EXPECT_TRUE(response.solution().options().has_max_iterations());
}

TEST_F(Solve, EndsWithTheBestIterateAtTheIterationLimit) {
  start();
  v1::SolveResponse response;
  ASSERT_TRUE(solve(long_request(3), &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_ITERATION_LIMIT);
  EXPECT_EQ(response.solution().iterations(), 3);
  EXPECT_EQ(response.solution().z_size(), long_request().problem().gradient_size());
}

TEST_F(Solve, EndsWithTheBestIterateAtTheTimeLimit) {
  start();
  v1::SolveRequest request = long_request();
  request.mutable_options()->set_time_limit_s(0.05);
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  EXPECT_EQ(response.solution().status(), v1::STATUS_TIME_LIMIT);
  EXPECT_EQ(response.solution().z_size(), request.problem().gradient_size());
}

TEST_F(Solve, LogsOneLineAJobWithTheClientsOwnId) {
  start({"--log-format", "json"});
  v1::SolveRequest request = example_request();
  request.set_request_id("tick 17");
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  const std::vector<std::string> own = {"\"event\":\"job\"", response.job_id()};
  ASSERT_TRUE(eventually([&] { return !server().log_lines(own).empty(); }));
  const auto lines = server().log_lines(own);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("\"request\":\"tick 17\""), std::string::npos) << lines[0];
  EXPECT_NE(lines[0].find("\"status\":\"solved\""), std::string::npos) << lines[0];
}

TEST_F(Solve, NoClientCanForgeALogLine) {
  start();
  v1::SolveRequest request = example_request();
  request.mutable_problem()->set_name("x\njob job=\"forged\"\x1b[2J");
  v1::SolveResponse response;
  ASSERT_TRUE(solve(request, &response).ok());
  EXPECT_TRUE(eventually([&] { return server().log_lines({response.job_id()}).size() == 1; }));
  EXPECT_TRUE(server().log_lines({"job=\"forged\""}).empty()) << server().log();
  EXPECT_EQ(server().log().find('\x1b'), std::string::npos);
}

TEST_F(Solve, WorksOverAUnixSocket) {
  const TemporaryDirectory directory;
  const std::string address = "unix:" + directory.file("socket");
  start({"--listen", address});
  EXPECT_EQ(server().address(), address);
  EXPECT_TRUE(lives());
}

// SolveStream: events in order, cancellation, and readers that do not keep up.
class SolveStream : public ServiceTest {
 protected:
  static v1::SolveRequest with_starts(int starts) {
    v1::SolveRequest request;
    to_message(examples::hopper({.steps = 40}).view(), request.mutable_problem());
    request.mutable_options()->set_num_starts(starts);
    return request;
  }
  /// A client of this kind is killed while its solve runs.
  void expect_free_after_kill(const std::vector<std::string>& kind) {
    const TemporaryDirectory directory;
    std::vector<std::string> command = {STREAM_CLIENT_BINARY, server().address()};
    command.insert(command.end(), kind.begin(), kind.end());
    ChildProcess client(command, directory.file("client"));
    ASSERT_TRUE(eventually([&] { return client.output().find("running") != std::string::npos; }))
        << client.output();
    EXPECT_EQ(counters().running(), 1);
    client.send(SIGKILL);
    EXPECT_EQ(client.wait(), -SIGKILL);
    EXPECT_TRUE(eventually_idle());
    EXPECT_TRUE(lives());
  }
};

TEST_F(SolveStream, ReportsAcceptedThenStartedThenProgressThenTheResult) {
  start();
  Stream stream(solver(), example_request());
  const std::vector<Event> events = stream.drain();
  const grpc::Status status = stream.finish();
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_GE(events.size(), 4U);
  ASSERT_TRUE(events[0].has_accepted());
  EXPECT_TRUE(events[1].has_started());
  for (std::size_t i = 2; i + 1 < events.size(); ++i) EXPECT_TRUE(events[i].has_progress()) << i;
  ASSERT_TRUE(events.back().has_result());
  EXPECT_EQ(events.back().result().job_id(), events[0].accepted().job_id());
  EXPECT_EQ(events.back().result().solution().status(), v1::STATUS_SOLVED);
}

// Further starts have no iterations of their own to report.
TEST_F(SolveStream, ReportsWhatItDoesWhereNoIterationEnds) {
  start();
  v1::SolveRequest request = with_starts(500);
  Stream stream(solver(), request);
  std::optional<v1::Activity> quiet;
  while (const auto event = stream.next()) {
    if (!event->has_progress()) continue;
    ASSERT_TRUE(event->progress().has_activity());
    const v1::Activity& activity = event->progress().activity();
    if (event->progress().rows_size() > 0 || activity.phase() != v1::PHASE_STARTS) continue;
    if (activity.total() == 0) continue;  // starts within effort, whose number is not known before
    quiet = activity;
    break;
  }
  ASSERT_TRUE(quiet.has_value());
  EXPECT_EQ(quiet->total(), 500);
  EXPECT_TRUE(quiet->has_incumbent());
  EXPECT_EQ(quiet->text().rfind("further starts: ", 0), 0U) << quiet->text();
  stream.cancel();
}

TEST_F(SolveStream, ProgressAdvancesAndCountsWhatItSkipped) {
  start();
  Stream stream(solver(), long_request(200));
  int last = -1;
  std::int64_t reported = 0, skipped = 0;
  std::optional<v1::SolveResponse> result;
  while (const auto event = stream.next()) {
    if (event->has_result()) result = event->result();
    if (!event->has_progress()) continue;
    for (const v1::Progress& row : event->progress().rows()) {
      EXPECT_GT(row.iteration(), last);
      EXPECT_EQ(row.z_size(), 0);
      last = row.iteration();
      ++reported;
    }
    EXPECT_GE(event->progress().skipped(), skipped);
    skipped = event->progress().skipped();
  }
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->solution().iterations(), 200);
  EXPECT_EQ(last, 200) << "the last progress is the newest";
  EXPECT_EQ(reported + skipped, 201) << "every iteration, and the start, was reported or counted";
}

TEST_F(SolveStream, AttachesTheIterateWhenAsked) {
  start();
  v1::SolveStreamRequest request;
  *request.mutable_solve() = long_request(40);
  request.set_iterate_every(10);
  Stream stream(solver(), request);
  int with_iterate = 0;
  while (const auto event = stream.next()) {
    if (!event->has_progress()) continue;
    const auto& rows = event->progress().rows();
    for (int i = 0; i < rows.size(); ++i) {
      const bool turn = i + 1 == rows.size() && rows[i].iteration() % 10 == 0;
      EXPECT_EQ(rows[i].z_size(), turn ? request.solve().problem().gradient_size() : 0);
      with_iterate += turn ? 1 : 0;
    }
  }
  EXPECT_TRUE(stream.finish().ok());
  EXPECT_GE(with_iterate, 1);
}

TEST_F(SolveStream, KeepsTheAskedIntervalBetweenProgress) {
  start();
  v1::SolveStreamRequest request;
  *request.mutable_solve() = long_request(100);
  request.set_progress_interval_s(1e6);
  Stream stream(solver(), request);
  int reported = 0;
  for (const Event& event : stream.drain()) reported += event.progress().rows_size();
  EXPECT_EQ(reported, 1) << "the first, and no second within the interval";
}

TEST_F(SolveStream, TwoRunAtOnceOnTwoWorkers) {
  start({"--workers", "2"});
  Stream first(solver(), long_request());
  ASSERT_TRUE(first.read_until(Event::kProgress));
  Stream second(solver(), long_request());
  ASSERT_TRUE(second.read_until(Event::kProgress));
  ASSERT_TRUE(first.read_until(Event::kProgress));
  EXPECT_EQ(counters().running(), 2);
}

TEST_F(SolveStream, CancelStopsARunningSolveAndFreesItsWorker) {
  start({"--workers", "1"});
  Stream stream(solver(), long_request());
  ASSERT_TRUE(stream.read_until(Event::kProgress));
  stream.cancel();
  EXPECT_EQ(stream.finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(eventually_idle());
  EXPECT_EQ(counters().cancelled_total(), 1);
  EXPECT_TRUE(lives());
}

TEST_F(SolveStream, CancelTakesAWaitingJobOutOfTheQueue) {
  start({"--workers", "1"});
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  Stream waiting(solver(), example_request());
  ASSERT_TRUE(waiting.read_until(Event::kAccepted));
  EXPECT_EQ(counters().queued(), 1);
  waiting.cancel();
  EXPECT_EQ(waiting.finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(eventually([&] { return counters().queued() == 0; }));
  EXPECT_EQ(counters().running(), 1);
}

TEST_F(SolveStream, AKilledClientFreesItsWorker) {
  start({"--workers", "1"});
  expect_free_after_kill({});
}

TEST_F(SolveStream, AClientKilledInTheMiddleOfAProofFreesItsWorkers) {
  start({"--workers", "2"});
  expect_free_after_kill({"proof"});
}

TEST_F(SolveStream, AFrozenClientCountsAsDeadAndFreesItsWorker) {
  start({"--workers", "1", "--keepalive-s", "1"});
  const TemporaryDirectory directory;
  ChildProcess client({STREAM_CLIENT_BINARY, server().address()}, directory.file("client"));
  ASSERT_TRUE(eventually([&] { return client.output().find("running") != std::string::npos; }));
  client.send(SIGSTOP);  // its connection stays open, and nobody answers on it
  EXPECT_TRUE(eventually_idle());
  EXPECT_TRUE(lives());
}

TEST_F(SolveStream, AStalledReaderCostsTheSolveNothing) {
  start({"--workers", "1"});
  v1::SolveStreamRequest request;
  *request.mutable_solve() = long_request(1000);
  request.set_iterate_every(1);  // 48 kB each: far more than any window of flow control
  Stream stalled(solver(), request);
  // Nobody reads, and yet the solve runs to its end and the worker is free for others.
  ASSERT_TRUE(eventually([&] { return counters().answered_total() == 1; }));
  EXPECT_TRUE(lives());
  const std::vector<Event> events = stalled.drain();
  ASSERT_TRUE(stalled.finish().ok());
  ASSERT_GE(events.size(), 4U);
  int rows = 0;
  for (const Event& event : events) rows += event.progress().rows_size();
  const v1::ProgressRows& last = events[events.size() - 2].progress();
  EXPECT_LT(rows, 1001) << "what nobody read was not kept";
  EXPECT_EQ(rows + last.skipped(), 1001) << "but counted";
  ASSERT_GT(last.rows_size(), 0);
  EXPECT_EQ(last.rows().rbegin()->iteration(), 1000);
  ASSERT_TRUE(events.back().has_result()) << "the result always comes";
}

}  // namespace
}  // namespace marble::testing
