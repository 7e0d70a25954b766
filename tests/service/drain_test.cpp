// SIGTERM: nothing new is admitted, everything accepted gets exactly one answer, exit code 0.
#include <httplib.h>

#include <thread>

#include "service_test.h"

namespace marble::testing {
namespace {

class Drain : public ServiceTest {};

struct Answer {
  bool accepted = false;
  int results = 0;
  v1::Status solved_as = v1::STATUS_UNSPECIFIED;
  int z_size = 0;
  grpc::Status status;
};

Answer read_to_the_end(Stream& stream) {
  Answer answer;
  while (const auto event = stream.next()) {
    answer.accepted = answer.accepted || event->has_accepted();
    if (!event->has_result()) continue;
    ++answer.results;
    answer.solved_as = event->result().solution().status();
    answer.z_size = event->result().solution().z_size();
  }
  answer.status = stream.finish();
  return answer;
}

TEST_F(Drain, AnIdleServerStopsAtOnce) {
  start();
  EXPECT_TRUE(lives());
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, InterruptStopsItToo) {
  start();
  server().send(SIGINT);
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, RunningAndWaitingJobsAreFinished) {
  start({"--workers", "2", "--drain-grace-s", "3600"});
  std::vector<std::unique_ptr<Stream>> streams;
  for (int i = 0; i < 8; ++i) {
    streams.push_back(std::make_unique<Stream>(solver(), long_request(300)));
    ASSERT_TRUE(streams.back()->read_until(Event::kAccepted));
  }
  server().terminate();
  for (const auto& stream : streams) {
    const Answer answer = read_to_the_end(*stream);
    EXPECT_TRUE(answer.status.ok()) << answer.status.error_message();
    EXPECT_EQ(answer.results, 1);
    EXPECT_EQ(answer.solved_as, v1::STATUS_ITERATION_LIMIT);
  }
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, NothingNewIsAdmittedWhileOldJobsFinish) {
  start({"--workers", "1", "--drain-grace-s", "3600"});
  EXPECT_EQ(health(), "SERVING");
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  server().terminate();
  ASSERT_TRUE(eventually([&] { return health() == "NOT_SERVING"; }));
  v1::SolveResponse response;
  EXPECT_EQ(solve(example_request(), &response).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_TRUE(running.read_until(Event::kProgress)) << "what runs goes on";
  EXPECT_TRUE(server().running());
}

TEST_F(Drain, InItsTimeOfNoticeItSaysThatItLeavesAndTakesEverything) {
  start({"--workers", "1", "--drain-notice-s", "3600", "--http", "127.0.0.1:0"});
  httplib::Client http(server().http());
  EXPECT_EQ(http.Get("/readyz")->status, 200);
  server().terminate();
  ASSERT_TRUE(eventually([&] { return health() == "NOT_SERVING"; }));
  EXPECT_TRUE(eventually([&] { return http.Get("/readyz")->status == 503; }));
  v1::SolveResponse response;
  EXPECT_TRUE(solve(example_request(), &response).ok()) << "a client that has not asked yet is served";
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  server().terminate();
  EXPECT_EQ(read_to_the_end(running).solved_as, v1::STATUS_CANCELLED) << "a second signal ends all patience";
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, AfterItsTimeOfNoticeItStops) {
  start({"--workers", "1", "--drain-notice-s", "0.2", "--drain-grace-s", "300"});
  Stream running(solver(), long_request(300));
  ASSERT_TRUE(running.read_until(Event::kStarted));
  server().terminate();
  EXPECT_EQ(read_to_the_end(running).solved_as, v1::STATUS_ITERATION_LIMIT);
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, AfterTheGraceRunningJobsGiveTheirBestIterate) {
  start({"--workers", "2", "--drain-grace-s", "0.1"});
  Stream first(solver(), long_request()), second(solver(), long_request());
  ASSERT_TRUE(first.read_until(Event::kProgress));
  ASSERT_TRUE(second.read_until(Event::kProgress));
  server().terminate();
  for (Stream* stream : {&first, &second}) {
    const Answer answer = read_to_the_end(*stream);
    EXPECT_TRUE(answer.status.ok()) << answer.status.error_message();
    EXPECT_EQ(answer.results, 1);
    EXPECT_EQ(answer.solved_as, v1::STATUS_CANCELLED);
    EXPECT_EQ(answer.z_size, long_request().problem().gradient_size());
  }
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, AfterTheGraceWaitingJobsMayBeRetriedElsewhere) {
  start({"--workers", "1", "--drain-grace-s", "0.1"});
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  Stream waiting(solver(), long_request());
  ASSERT_TRUE(waiting.read_until(Event::kAccepted));
  server().terminate();
  EXPECT_EQ(read_to_the_end(running).solved_as, v1::STATUS_CANCELLED);
  const Answer answer = read_to_the_end(waiting);
  EXPECT_EQ(answer.status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(answer.results, 0);
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, ASecondSignalEndsTheGrace) {
  start({"--workers", "1", "--drain-grace-s", "3600"});
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  server().terminate();
  ASSERT_TRUE(eventually([&] { return health() == "NOT_SERVING"; }));
  server().terminate();
  const Answer answer = read_to_the_end(running);
  EXPECT_EQ(answer.results, 1);
  EXPECT_EQ(answer.solved_as, v1::STATUS_CANCELLED);
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, AStalledReaderDoesNotHoldItUp) {
  start({"--workers", "1", "--drain-grace-s", "0.1"});
  v1::SolveStreamRequest request;
  *request.mutable_solve() = long_request();
  request.set_iterate_every(1);
  Stream stalled(solver(), request);
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Drain, UnderLoadEveryAcceptedJobEndsExactlyOnce) {
  start({"--workers", "2", "--queue-jobs", "16", "--client-queued", "0", "--drain-grace-s", "0.3"});
  constexpr int kClients = 6;
  std::atomic<int> accepted = 0;
  std::vector<std::vector<Answer>> answers(kClients);
  std::vector<std::thread> clients;
  for (int c = 0; c < kClients; ++c) {
    clients.emplace_back([&, c] {
      const auto stub = v1::Solver::NewStub(connect(server().address()));
      for (bool serving = true; serving;) {
        Stream stream(*stub, long_request(20 + 10 * c));
        answers[static_cast<std::size_t>(c)].push_back(read_to_the_end(stream));
        const Answer& answer = answers[static_cast<std::size_t>(c)].back();
        accepted += answer.accepted ? 1 : 0;
        serving = answer.status.error_code() != grpc::StatusCode::UNAVAILABLE;
      }
    });
  }
  EXPECT_TRUE(eventually([&] { return accepted > 2 * kClients; }));
  server().terminate();
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(server().wait(), 0);
  for (const auto& client : answers) {
    for (const Answer& answer : client) {
      if (answer.status.ok()) {
        EXPECT_EQ(answer.results, 1);
        EXPECT_TRUE(answer.solved_as == v1::STATUS_ITERATION_LIMIT ||
                    answer.solved_as == v1::STATUS_CANCELLED);
      } else {
        EXPECT_EQ(answer.status.error_code(), grpc::StatusCode::UNAVAILABLE) << answer.status.error_message();
        EXPECT_EQ(answer.results, 0);
      }
    }
  }
}

}  // namespace
}  // namespace marble::testing
