// Event streams of the HTTP port: live, shared, bounded, and ended when they must be.
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>

#include "http_service_test.h"

namespace marble::testing {
namespace {

using HttpEvents = HttpServiceTest;

TEST_F(HttpEvents, ADashboardIsReportedWhoItIsThenTheServerThenEveryJob) {
  start();
  const EventReader reader(server().http(), "/api/events");
  ASSERT_TRUE(reader.eventually_has("server"));
  EXPECT_EQ(reader.events("hello").at(0).data.at("client"), "127.0.0.1");
  EXPECT_EQ(reader.events("hello").at(0).data.at("options"), Json::array());
  EXPECT_EQ(reader.events("server").at(0).data.at("state"), "serving");
  EXPECT_EQ(reader.events("server").at(0).data.at("jobs_watchers"), 1);
  const std::string id = submit(example_request());
  EXPECT_TRUE(eventually([&] {
    for (const auto& message : reader.events("jobs")) {
      for (const Json& event : message.data.at("events")) {
        if (event.at("job").at("job_id") == id && event.at("job").at("state") == "JOB_STATE_FINISHED")
          return true;
      }
    }
    return false;
  }));
}

TEST_F(HttpEvents, OneJobReportsItsTraceThenItsRowsThenItsEnd) {
  start();
  const std::string id = submit(long_request());
  const EventReader reader(server().http(), "/api/jobs/" + id + "/events");
  ASSERT_TRUE(eventually([&] { return reader.events("job").size() >= 3; }));
  EXPECT_TRUE(reader.events("job").at(0).data.at("events").at(0).contains("trace"));
  ASSERT_EQ(cancel(id)->status, 200);
  ASSERT_TRUE(eventually([&] { return reader.ended(); }));
  EXPECT_EQ(reader.events("end").size(), 1U);
  const auto messages = reader.events("job");
  const Json last = messages.back().data.at("events").at(0);
  EXPECT_EQ(last.at("job").at("state"), "JOB_STATE_FINISHED");
  std::int64_t iteration = -1;
  for (const auto& message : messages) {
    const Json& reported = message.data.at("events").at(0);
    for (const Json& row :
         reported.contains("trace") ? reported.at("trace").at("rows") : reported.at("rows")) {
      EXPECT_GT(row.at("iteration").get<std::int64_t>(), iteration) << "rows come once, in order";
      iteration = row.at("iteration").get<std::int64_t>();
    }
  }
  EXPECT_EQ(std::to_string(iteration), last.at("job").at("iterations").get<std::string>());
}

TEST_F(HttpEvents, WhoComesLaterIsReportedWhatWas) {
  start();
  const std::string id = submit(long_request());
  const EventReader first(server().http(), "/api/jobs/" + id + "/events");
  ASSERT_TRUE(eventually([&] { return first.events("job").size() >= 3; }));
  const EventReader second(server().http(), "/api/jobs/" + id + "/events");
  ASSERT_TRUE(second.eventually_has("job"));
  const Json reported = second.events("job").at(0).data.at("events").at(0);
  ASSERT_TRUE(reported.contains("trace"));
  EXPECT_EQ(reported.at("trace").at("rows").at(0).at("iteration"), 0);
  ASSERT_EQ(cancel(id)->status, 200);
  EXPECT_TRUE(eventually([&] { return first.ended() && second.ended(); }));
}

TEST_F(HttpEvents, AJobThatIsNotThereIsNoStream) {
  start();
  const auto answer = get("/api/jobs/none/events");
  EXPECT_EQ(answer->status, 404);
  EXPECT_EQ(error_of(answer).at("value"), "none");
}

TEST_F(HttpEvents, WatchersAreLimitedAndLeaveTheirPlace) {
  start({"--watchers", "2", "--client-watchers", "0"});
  {
    const EventReader first(server().http(), "/api/events"), second(server().http(), "/api/events");
    ASSERT_TRUE(first.eventually_has("server") && second.eventually_has("server"));
    const auto third = get("/api/events");
    EXPECT_EQ(third->status, 429);
    EXPECT_EQ(error_of(third).at("field"), "watchers");
  }
  EXPECT_TRUE(eventually([&] {
    const EventReader again(server().http(), "/api/events");
    return eventually([&] { return again.status() != 0; }) && again.status() == 200;
  }));
}

TEST_F(HttpEvents, StreamsLeaveConnectionsForRequests) {
  start({"--http-connections", "8"});
  std::vector<std::unique_ptr<EventReader>> readers;
  for (int i = 0; i < 6; ++i)
    readers.push_back(std::make_unique<EventReader>(server().http(), "/api/events"));
  for (const auto& reader : readers) ASSERT_TRUE(reader->eventually_has("server"));
  const auto refused = get("/api/events");
  EXPECT_EQ(refused->status, 429);
  EXPECT_EQ(error_of(refused).at("field"), "http_connections");
  EXPECT_EQ(get("/api/info")->status, 200);
}

TEST_F(HttpEvents, AReaderThatStallsDisturbsNobody) {
  start({"--history-jobs", "10000"});
  constexpr std::size_t kJobs = 1000;  // more than the stalled reader's buffers hold
  const std::string url = server().http();
  const int stalled = socket(AF_INET, SOCK_STREAM, 0);
  const int little = 4096;
  setsockopt(stalled, SOL_SOCKET, SO_RCVBUF, &little, sizeof little);
  connect_to(url, stalled);
  const std::string request = "GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n";
  ASSERT_EQ(send(stalled, request.data(), request.size(), 0), static_cast<ssize_t>(request.size()));
  const EventReader reader(url, "/api/events");
  ASSERT_TRUE(reader.eventually_has("server"));
  std::size_t reported = 0;
  for (std::size_t i = 0; i < kJobs; ++i) {
    v1::SolveResponse response;
    ASSERT_TRUE(solve(example_request(), &response).ok());
  }
  EXPECT_TRUE(eventually([&] {
    reported = 0;
    for (const auto& message : reader.events("jobs")) {
      for (const Json& event : message.data.at("events"))
        reported += event.at("job").at("state") == "JOB_STATE_FINISHED" ? 1 : 0;
    }
    return reported == kJobs;
  })) << reported;
  EXPECT_TRUE(reader.events("reload").empty());
  close(stalled);
}

TEST_F(HttpEvents, ADrainIsReportedAndTheStreamEndsWithTheServer) {
  start({"--drain-grace-s", "30"});
  const EventReader reader(server().http(), "/api/events");
  Stream stuck(solver(), long_request());
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  server().terminate();
  EXPECT_TRUE(eventually([&] {
    const auto reported = reader.events("server");
    return !reported.empty() && reported.back().data.at("state") == "draining";
  }));
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
  EXPECT_TRUE(eventually([&] { return reader.ended(); }));
}

TEST_F(HttpEvents, ATokenTakenAwayEndsItsStream) {
  const Token stays = new_token("stays:observe"), goes = new_token("goes:observe");
  const std::string file = write("tokens", stays.line + goes.line);
  start({"--tokens", file});
  const EventReader kept(server().http(), "/api/events", bearer_header(stays.secret));
  const EventReader ended(server().http(), "/api/events", bearer_header(goes.secret));
  ASSERT_TRUE(kept.eventually_has("server") && ended.eventually_has("server"));
  write("tokens", stays.line);
  server().send(SIGHUP);
  EXPECT_TRUE(eventually([&] { return ended.ended(); }));
  EXPECT_FALSE(kept.ended());
}

}  // namespace
}  // namespace marble::testing
