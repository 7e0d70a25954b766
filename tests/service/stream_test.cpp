// SolveStream: events in order, cancellation, and readers that do not keep up.
#include "marble/convert.h"
#include "marble/examples.h"
#include "service_test.h"

namespace marble::testing {
namespace {

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
