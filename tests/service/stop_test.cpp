#include <gmock/gmock.h>
#include <httplib.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cstdlib>
#include <cstring>
#include <map>
#include <ostream>
#include <thread>

#include "fleet_node.h"
#include "service_test.h"
#include "support/postgres_process.h"

namespace marble::testing {
namespace {

// SIGTERM: nothing new is admitted, everything accepted gets exactly one answer, exit code 0.
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

// Servers killed at the moments where a promise could break, with either store: accepted means kept, and is
// answered once.
struct Moment {
  const char* point;
  const char* store;
};
void PrintTo(const Moment& moment, std::ostream* out) { *out << moment.point << ", " << moment.store; }

class Crash : public ::testing::TestWithParam<Moment> {
 protected:
  /// Dies by itself at the `pass`-th time that it comes by the moment; 0: lives.
  [[nodiscard]] std::unique_ptr<Node> start(int pass) {
    std::vector<std::string> flags = {"--workers", "1", "--job-starts",
                                      "1000"};  // the kills are no job's fault
    if (database_) {
      flags.insert(flags.end(), {"--state", database_->uri(), "--state-lease-s", "1"});
    } else {
      flags.insert(flags.end(), {"--state-dir", directory_.file("state")});
    }
    const std::string fault = std::string(GetParam().point) + ":" + std::to_string(pass);
    setenv("MARBLE_FAULT_POINT", fault.c_str(), 1);
    auto node = std::make_unique<Node>(flags);
    unsetenv("MARBLE_FAULT_POINT");
    return node;
  }

  TemporaryDirectory directory_;
  const std::unique_ptr<PostgresProcess> database_ =
      GetParam().store == std::string("fleet") ? std::make_unique<PostgresProcess>(MARBLE_POSTGRES_DIR)
                                               : nullptr;
};

// Clients that submit and fetch go on at the server that comes after the dead one, as clients do.
TEST_P(Crash, EachAcceptedJobIsAnsweredOnce) {
  constexpr int kCrashes = 3, kPass = 7, kMost = 400;
  const auto other = database_ ? start(0) : nullptr;  // which may have taken what the dead one ran
  auto node = start(kPass);
  int crashes = 0;
  const auto until_done = [&](const auto& call) {
    ASSERT_TRUE(eventually([&] {
      if (call().error_code() != grpc::StatusCode::UNAVAILABLE) return true;
      if (!eventually([&] { return !node->server().running(); }, std::chrono::seconds(10))) return false;
      EXPECT_EQ(node->server().wait(), -SIGKILL) << node->server().log();
      node = start(++crashes < kCrashes ? kPass + crashes : 0);
      return false;
    }));
  };
  std::map<std::string, int> accepted;
  for (int i = 0; i < kMost && crashes < kCrashes; ++i) {
    std::string id;
    until_done([&] { return node->submit(numbered(i), &id); });
    EXPECT_TRUE(accepted.emplace(id, i).second) << "it is a job of its own";
    v1::SolveResponse response;
    until_done([&] { return node->result(id, true, &response); });
    EXPECT_NEAR(response.solution().objective(), 3.0 + i, 1e-9);
  }
  EXPECT_EQ(crashes, kCrashes);
  for (const auto& [id, number] : accepted) {
    expect_answer(*node, id, number);
    EXPECT_EQ(node->submit(numbered(number)), id) << "what was sent again is the same job";
  }
  EXPECT_EQ(node->list().size(), accepted.size());
  if (database_) {
    EXPECT_EQ(database_->ask("SELECT count(*) FROM marble_answers"), std::to_string(accepted.size()));
  }
}

INSTANTIATE_TEST_SUITE_P(Moments, Crash,
                         ::testing::Values(Moment{"before_commit", "one"}, Moment{"after_commit", "one"},
                                           Moment{"before_answer", "one"}, Moment{"within_answer", "one"},
                                           Moment{"before_commit", "fleet"}, Moment{"after_commit", "fleet"},
                                           Moment{"before_answer", "fleet"},
                                           Moment{"within_answer", "fleet"}),
                         [](const auto& moment) {
                           return std::string(moment.param.point) + "_" + moment.param.store;
                         });

// What systemd, or another owner of NOTIFY_SOCKET, receives: ready, reloading, stopping, in that order and
// not before.

/// A datagram socket as systemd has one.
class NotifySocket {
 public:
  /// `name` is a path, or begins with @ for an abstract name.
  explicit NotifySocket(const std::string& name) {
    sockaddr_un address = {};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, name.data(), name.size());
    if (name[0] == '@') address.sun_path[0] = '\0';
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    bound_ = bind(socket_, reinterpret_cast<const sockaddr*>(&address), length) == 0;
    setenv("NOTIFY_SOCKET", name.c_str(), 1);
  }
  ~NotifySocket() {
    unsetenv("NOTIFY_SOCKET");
    close(socket_);
  }
  [[nodiscard]] bool bound() const { return bound_; }
  /// The next message; empty if none came for a minute.
  [[nodiscard]] std::string next() const {
    pollfd waiting = {socket_, POLLIN, 0};
    char text[512];
    if (poll(&waiting, 1, 60'000) != 1) return "";
    const ssize_t size = recv(socket_, text, sizeof text, 0);
    return size > 0 ? std::string(text, static_cast<std::size_t>(size)) : "";
  }
  [[nodiscard]] bool silent() const {
    pollfd waiting = {socket_, POLLIN, 0};
    return poll(&waiting, 1, 0) == 0;
  }

 private:
  int socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  bool bound_ = false;
};

class Supervised : public ServiceTest {
 protected:
  TemporaryDirectory directory_;
};

TEST_F(Supervised, IsReportedWhenItAnswersReadsItsConfigurationAgainAndStops) {
  const NotifySocket systemd(directory_.file("notify"));
  ASSERT_TRUE(systemd.bound());
  start();
  EXPECT_EQ(systemd.next(), "READY=1");
  EXPECT_TRUE(lives());
  server().send(SIGHUP);
  EXPECT_EQ(systemd.next().rfind("RELOADING=1\nMONOTONIC_USEC=", 0), 0U);
  EXPECT_EQ(systemd.next(), "READY=1");
  EXPECT_TRUE(systemd.silent());
  server().terminate();
  EXPECT_EQ(systemd.next(), "STOPPING=1");
}

TEST_F(Supervised, HearsOfTheStopBeforeTheJobsHaveEnded) {
  const NotifySocket systemd(directory_.file("notify"));
  start({"--workers", "1", "--drain-grace-s", "3600"});
  EXPECT_EQ(systemd.next(), "READY=1");
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  server().terminate();
  EXPECT_EQ(systemd.next(), "STOPPING=1");
  EXPECT_TRUE(running.read_until(Event::kProgress)) << "what runs goes on";
  server().terminate();
}

TEST_F(Supervised, MayListenAtAnAbstractName) {
  const NotifySocket systemd("@marble test " + std::to_string(getpid()));
  ASSERT_TRUE(systemd.bound());
  start();
  EXPECT_EQ(systemd.next(), "READY=1");
}

TEST_F(Supervised, MayBeGone) {
  setenv("NOTIFY_SOCKET", directory_.file("nobody").c_str(), 1);
  start();
  unsetenv("NOTIFY_SOCKET");
  EXPECT_TRUE(lives());
}

}  // namespace
}  // namespace marble::testing
