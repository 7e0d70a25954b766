#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <functional>
#include <future>
#include <map>
#include <string>
#include <thread>

#include "marble/batch.h"
#include "marble/client.h"
#include "marble/session.h"
#include "marble/v1/service.grpc.pb.h"
#include "support/child_process.h"
#include "support/loopback.h"
#include "support/random_problem.h"
#include "support/server_process.h"

namespace marble::testing {

// Takes the address of a server that was lost: accepts connections, and closes them at once.
class AbsentServer {
 public:
  /// Of a server that was on "127.0.0.1:4711".
  explicit AbsentServer(const std::string& address) {
    const int reuse = 1;
    setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse);
    listen_on(listener_, loopback(address));
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  ~AbsentServer() {
    thread_.request_stop();
    thread_.join();
    close(listener_);
  }
  AbsentServer(const AbsentServer&) = delete;
  AbsentServer& operator=(const AbsentServer&) = delete;

  /// Waits until clients have connected so often. False if that takes too long.
  [[nodiscard]] bool was_sought(int times) const {
    return eventually([&] { return connections_ >= times; });
  }

 private:
  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      std::array ends = {pollfd{listener_, POLLIN, 0}};
      if (poll(ends.data(), ends.size(), 10) <= 0) continue;
      close(accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC));
      ++connections_;
    }
  }

  const int listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  std::atomic<int> connections_ = 0;
  std::jthread thread_;
};

namespace {

// Who a client says it is, and what it refuses to start with.

/// Answers GetInfo, and remembers what came with it.
class Listener final : public v1::Server::Service {
 public:
  Listener() {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  [[nodiscard]] std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  [[nodiscard]] std::string heard(const std::string& key) const {
    const auto found = metadata_.find(key);
    return found == metadata_.end() ? "" : found->second;
  }

 private:
  grpc::Status GetInfo(grpc::ServerContext* context, const v1::GetInfoRequest*,
                       v1::GetInfoResponse* response) override {
    for (const auto& [key, value] : context->client_metadata())
      metadata_[{key.data(), key.size()}] = {value.data(), value.size()};
    response->set_client("robot 7");
    response->add_roles("solve");
    response->mutable_limits()->mutable_quota()->set_sessions(3);
    return grpc::Status::OK;
  }

  std::map<std::string, std::string> metadata_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

TEST(Connect, TokenAndNameAreSentWithACall) {
  const Listener listener;
  const auto client = Client::connect(listener.address(), {.token = "s3cret", .name = "arm of robot 7"});
  ASSERT_TRUE(client.has_value());
  const auto info = client->info();
  ASSERT_TRUE(info.has_value()) << info.error().message();
  EXPECT_EQ(listener.heard("authorization"), "Bearer s3cret");
  EXPECT_EQ(listener.heard("marble-client"), "arm of robot 7");
  EXPECT_EQ(info->client, "robot 7");
  EXPECT_EQ(info->roles, std::vector<std::string>{"solve"});
  EXPECT_EQ(info->quota->sessions, 3);
}

TEST(Connect, NothingIsSentUnasked) {
  const Listener listener;
  ASSERT_TRUE(Client::connect(listener.address(), ConnectOptions{})->info().has_value());
  EXPECT_EQ(listener.heard("authorization"), "");
  EXPECT_EQ(listener.heard("marble-client"), "");
}

TEST(Connect, TheEnvironmentHasTheDefaults) {
  setenv("MARBLE_TOKEN", "from outside", 1);
  setenv("MARBLE_TLS_CA", "ca.pem", 1);
  const ConnectOptions options = ConnectOptions::from_environment();
  unsetenv("MARBLE_TOKEN");
  unsetenv("MARBLE_TLS_CA");
  EXPECT_EQ(options.token, "from outside");
  EXPECT_EQ(options.tls_ca, "ca.pem");
  EXPECT_EQ(options.tls_key, "");
}

TEST(Connect, ABadOptionIsAnErrorThatNamesIt) {
  const TemporaryDirectory directory;
  const std::string text = directory.file("text");
  std::ofstream(text) << "no certificate\n";
  const std::string pem = directory.file("pem");
  std::ofstream(pem) << "-----BEGIN CERTIFICATE-----\n";
  const std::pair<const char*, ConnectOptions> cases[] = {
      {"tls_ca", {.tls_ca = directory.file("missing")}},
      {"tls_ca", {.tls_ca = directory.file(".")}},
      {"tls_ca", {.tls_ca = text}},
      {"tls_certificate", {.tls_certificate = text, .tls_key = pem}},
      {"tls_key", {.tls_certificate = pem, .tls_key = directory.file("missing")}},
      {"tls_key", {.tls_certificate = pem}},
      {"tls_certificate", {.tls_key = pem}},
      {"token", {.token = "two words"}},
      {"token", {.token = "line\n"}},
      {"name", {.name = std::string(65, 'x')}},
      {"name", {.name = "\xc3\xa4"}},
      {"keepalive.silence", {.keepalive = {.silence = std::chrono::milliseconds(499)}}},
      {"keepalive.silence", {.keepalive = {.silence = std::chrono::hours(25)}}},
      {"keepalive.answer", {.keepalive = {.answer = std::chrono::seconds(0)}}},
      {"keepalive.answer", {.keepalive = {.answer = std::chrono::duration<double>(NAN)}}},
  };
  for (const auto& [field, options] : cases) {
    const auto client = Client::connect("127.0.0.1:1", options);
    ASSERT_FALSE(client.has_value()) << field;
    EXPECT_EQ(client.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(client.error().field, field) << client.error().message();
  }
  EXPECT_TRUE(Client::connect("127.0.0.1:1", {.tls = true, .token = "t", .name = "n"}).has_value());
}

TEST(Connect, AServerWithoutTlsIsUnavailableToAClientThatWantsIt) {
  const Listener listener;
  const auto info = Client::connect(listener.address(), {.tls = true})->info();
  ASSERT_FALSE(info.has_value());
  EXPECT_EQ(info.error().code, ErrorCode::unavailable);
  EXPECT_NE(info.error().message().find("does the server speak without TLS?"), std::string::npos)
      << info.error().message();
}

// As a server with TLS does with a client that begins without.
TEST(Connect, WhoIsShutOutIsAskedForTls) {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int port = listen_on(listener, loopback());
  std::thread shuts([&] {
    for (int one; (one = ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC)) >= 0;) ::close(one);
  });
  const auto info = Client::connect("127.0.0.1:" + std::to_string(port))->info();
  ::shutdown(listener, SHUT_RDWR);
  shuts.join();
  ::close(listener);
  ASSERT_FALSE(info.has_value());
  EXPECT_EQ(info.error().code, ErrorCode::unavailable);
  EXPECT_NE(info.error().message().find("does the server want TLS"), std::string::npos)
      << info.error().message();
}

TEST(Connect, WhereNobodyListensTlsIsNoReason) {
  const auto info = Client::connect("127.0.0.1:1")->info();
  ASSERT_FALSE(info.has_value());
  EXPECT_EQ(info.error().message().find("TLS"), std::string::npos) << info.error().message();
}

// Clients wait for a server that is absent for a while. gRPC connects every five seconds by itself, which is
// too late: this is off here, and each test runs in a process of its own.
constexpr std::int64_t kElements = 300, kBeforeAbsence = 20;
constexpr int kKindsOfElements = 7;
// Connections that a client tries before its server is back; with the second number, longer than gRPC repeats
// a call.
constexpr int kSought = 3, kSoughtForLong = 5;

class Absence : public ::testing::Test {
 protected:
  Absence() {
    setenv("GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS", "0", 1);
    for (int i = 0; i < kKindsOfElements; ++i)
      problems_.push_back(random_problem({}, static_cast<std::uint64_t>(i)));
    start("127.0.0.1:0");
    client_.emplace(Client::connect(server_->address()).value());
  }

  // The thread that starts a server must outlive it: the test's own.
  void start(const std::string& listen) {
    server_ = std::make_unique<ServerProcess>(
        MARBLE_SERVER_BINARY, std::vector<std::string>{"--listen", listen, "--batch-window", "8",
                                                       "--state-dir", state_.file("state")});
  }

  void lose_server() {
    server_->send(SIGKILL);
    static_cast<void>(server_->wait());
  }

  // Starts it again once the client has sought it so often.
  void restart(int sought) {
    const std::string address = server_->address();
    {
      const AbsentServer absent(address);
      EXPECT_TRUE(absent.was_sought(sought));
    }
    start(address);
  }

  [[nodiscard]] OwnedProblem& problem(std::int64_t index) {
    return problems_[static_cast<std::size_t>(index) % problems_.size()];
  }

  void take(std::int64_t index, const Expected<RemoteSolution>& answer) {
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_EQ(answer->z, solve_in_process(problem(index).view())->z) << index;
    ++answers_[index];
    ++answered_;
  }

  // Loses the server once some problems have their answers; the call must end with all of them.
  void expect_all(const std::function<Expected<void>()>& call, int sought) {
    auto done = std::async(std::launch::async, call);
    ASSERT_TRUE(eventually([&] { return answered_ >= kBeforeAbsence; }));
    lose_server();
    restart(sought);
    const Expected<void> ended = done.get();
    ASSERT_TRUE(ended.has_value()) << ended.error().message();
    EXPECT_EQ(answers_.size(), static_cast<std::size_t>(kElements));
    for (const auto& [index, count] : answers_) EXPECT_EQ(count, 1) << index;
  }

  [[nodiscard]] ArraySource elements() {
    return [this, next = std::int64_t{0}]() mutable -> std::optional<ArrayElement> {
      if (next == kElements) return std::nullopt;
      return ArrayElement{.problem = problem(next++).view()};
    };
  }

  std::vector<OwnedProblem> problems_;
  TemporaryDirectory state_;
  std::unique_ptr<ServerProcess> server_;
  std::optional<Client> client_;
  std::map<std::int64_t, int> answers_;
  std::atomic<std::int64_t> answered_ = 0;
};

TEST_F(Absence, ABatchContinuesWithItsUnsolvedProblems) {
  std::vector<BatchProblem> batch;
  for (std::int64_t i = 0; i < kElements; ++i) batch.push_back({.tag = i, .problem = problem(i).view()});
  expect_all(
      [&] {
        return client_->solve_batch(
            batch, [&](std::int64_t tag, const Expected<RemoteSolution>& answer) { take(tag, answer); });
      },
      kSought);
}

TEST_F(Absence, ReadingAnArrayContinuesAfterItsLastResult) {
  const auto array = client_->jobs().submit_array(elements());
  ASSERT_TRUE(array.has_value()) << array.error().message();
  expect_all(
      [&] {
        return client_->jobs().array(array->job_id,
                                     [&](const ArrayAnswer& one) { take(one.index, one.answer); });
      },
      kSoughtForLong);
}

TEST_F(Absence, AnArrayIsSubmittedOnceItsServerIsBack) {
  ASSERT_TRUE(client_->jobs().submit_array(elements()).has_value());
  lose_server();
  auto submitted = std::async(std::launch::async, [&] { return client_->jobs().submit_array(elements()); });
  restart(kSoughtForLong);
  const Expected<SubmittedArray> array = submitted.get();
  ASSERT_TRUE(array.has_value()) << array.error().message();
  EXPECT_EQ(array->elements, kElements);
}

TEST_F(Absence, ASessionIsReopened) {
  auto session = client_->open_session(problem(0).view(), {}, {.reopen = true});
  ASSERT_TRUE(session.has_value()) << session.error().message();
  ASSERT_TRUE(session->solve().has_value());
  lose_server();
  auto solved = std::async(std::launch::async, [&] { return session->solve(); });
  restart(kSought);
  const Expected<RemoteSolution> answer = solved.get();
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_TRUE(answer->reopened);
}

}  // namespace
}  // namespace marble::testing
