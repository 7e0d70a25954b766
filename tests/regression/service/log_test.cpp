#include <fcntl.h>
#include <httplib.h>
#include <poll.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "service/secure_service_test.h"
#include "service/service_test.h"

namespace marble::testing {
namespace {

// Symptom: Jobs.Get with bytes that are no UTF-8, from a caller without a token, filled the log with
// thousands of lines a second, "[libprotobuf ERROR wire_format_lite.cc:618] ...", none of them JSON with
// --log-format json. And GetInfo answered bytes that are no message with UNIMPLEMENTED. Cause: Jobs parsed a
// request before it asked who sent it, protobuf wrote to standard error by itself, and gRPC parsed what
// GetInfo was sent.
using grpc::StatusCode;

class LibraryLines : public SecureServiceTest {
 protected:
  StatusCode call(const std::string& method, const std::string& bytes, const std::string& token = "") {
    return raw_call(channel(), method, bytes, token).status.error_code();
  }
  const std::vector<std::string> kMethods = {"/marble.v1.Solver/Solve", "/marble.v1.Jobs/Submit",
                                             "/marble.v1.Jobs/Result",  "/marble.v1.Jobs/Delete",
                                             "/marble.v1.Jobs/List",    "/marble.v1.Jobs/Get",
                                             "/marble.v1.Jobs/Cancel",  "/marble.v1.Server/GetInfo"};
  const std::string kNoMessage = "\x0a\xff";       // a field longer than all there is
  const std::string kNoText = "\x0a\x02\xff\xfe";  // a text that is no UTF-8
};

TEST_F(LibraryLines, WhoIsNotKnownIsReportedSoBeforeARequestIsParsed) {
  start({"--tokens", write("tokens", new_token("planner:solve").line), "--log-format", "json"});
  for (const std::string& method : kMethods) {
    for (const std::string& bytes : {kNoMessage, kNoText})
      EXPECT_EQ(call(method, bytes), StatusCode::UNAUTHENTICATED) << method;
  }
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
  EXPECT_TRUE(server().log_lines({"protobuf"}).empty()) << server().log();
}

TEST_F(LibraryLines, WhatIsNoMessageIsAnInvalidArgumentEverywhere) {
  const Token token = new_token("planner:solve,observe,admin");
  start({"--tokens", write("tokens", token.line)});
  for (const std::string& method : kMethods)
    EXPECT_EQ(call(method, kNoMessage, token.secret), StatusCode::INVALID_ARGUMENT) << method;
}

TEST_F(LibraryLines, WhatProtobufHasToSayIsALineOfOursAndLimited) {
  start({"--log-format", "json", "--log-lines-per-s", "1"});
  for (int i = 0; i < 100; ++i) EXPECT_EQ(call("/marble.v1.Jobs/Get", kNoText), StatusCode::INVALID_ARGUMENT);
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
  int lines = 0, suppressed = 0;
  for (const std::string& text : server().log_lines({})) {
    const auto line = nlohmann::json::parse(text, nullptr, false);
    ASSERT_TRUE(line.is_object()) << text;
    const bool itself = line["event"] == "protobuf";
    lines += itself ? 1 : 0;
    if (itself || line.value("of", "") == "protobuf") suppressed += line.value("suppressed", 0);
  }
  EXPECT_GT(suppressed, 0);
  EXPECT_EQ(lines + suppressed, 100);
}

// Symptom: with standard error a pipe whose reader has stopped reading (a stopped container log driver, a
// hung
// `| tee`), no solve ended any more after a few seconds; health went on saying SERVING, and SIGTERM did not
// end the server. Cause: workers wrote their lines to the pipe themselves, and waited for its reader.

/// A server whose log is a pipe that nobody reads until asked to.
class StalledLog : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(mkfifo(directory_.file("log").c_str(), 0600), 0);
    log_ = open(directory_.file("log").c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK);
    ASSERT_GE(log_, 0);
  }
  void TearDown() override {
    server_.reset();
    close(log_);
  }

  void start() {
    const std::string file = directory_.file("address");
    server_ = std::make_unique<ChildProcess>(
        std::vector<std::string>{MARBLE_SERVER_BINARY, "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0",
                                 "--address-file", file, "--log-lines-per-s", "0", "--log-queue-bytes",
                                 "65536"},
        directory_.file("log"));
    ASSERT_TRUE(eventually([&] { return std::filesystem::exists(file); }));
    std::ifstream lines(file);
    std::getline(lines, address_);
    std::getline(lines, http_);
  }
  /// So many solves of several clients, all answered.
  void solve(int times) {
    constexpr int kClients = 4;
    std::atomic<int> solved = 0;
    std::vector<std::thread> clients;
    for (int c = 0; c < kClients; ++c) {
      clients.emplace_back([&] {
        const auto stub = v1::Solver::NewStub(connect(address_));
        for (int i = 0; i < times / kClients; ++i) {
          grpc::ClientContext context;
          context.set_deadline(std::chrono::system_clock::now() + std::chrono::minutes(2));
          v1::SolveResponse response;
          const grpc::Status status = stub->Solve(&context, example_request(), &response);
          if (!status.ok()) break;
          ++solved;
        }
      });
    }
    for (std::thread& client : clients) client.join();
    EXPECT_EQ(solved, times);
  }
  /// What is in the pipe, and comes until the last line.
  std::string read_until(const std::string& last) {
    std::string text;
    const auto take = [&] {
      char buffer[4096];
      for (ssize_t got = read(log_, buffer, sizeof buffer); got > 0; got = read(log_, buffer, sizeof buffer))
        text.append(buffer, static_cast<std::size_t>(got));
    };
    EXPECT_TRUE(eventually([&] {
      take();
      return text.find(last) != std::string::npos;
    })) << text;
    return text;
  }
  [[nodiscard]] double dropped_by_metrics() {
    const auto answer = httplib::Client(http_).Get("/metrics");
    const std::string name = "\nmarble_log_lines_dropped_total ";
    const std::size_t at = answer ? answer->body.find(name) : std::string::npos;
    return at == std::string::npos ? -1.0 : std::stod(answer->body.substr(at + name.size()));
  }

  TemporaryDirectory directory_;
  std::unique_ptr<ChildProcess> server_;
  std::string address_, http_;

 private:
  int log_ = -1;
};

TEST_F(StalledLog, SolvesGoOnAndWhatWasNotReadIsCounted) {
  start();
  solve(10'000);
  const double dropped = dropped_by_metrics();
  EXPECT_GT(dropped, 0.0);
  const std::string read = read_until("dropped=");  // by a line of its own, since nothing else happens
  std::istringstream lines(read);
  int jobs = 0;
  std::string time_before;
  for (std::string line; std::getline(lines, line);) {
    const std::string time = line.substr(0, line.find(' '));
    EXPECT_LE(time_before, time) << "out of order";
    time_before = time;
    jobs += line.find(" job component=job ") != std::string::npos ? 1 : 0;
  }
  const double reported = std::stod(read.substr(read.find("dropped=") + 8));
  EXPECT_EQ(reported, dropped);
  EXPECT_EQ(jobs + reported, 10'000) << read;
  server_->send(SIGTERM);
  EXPECT_NE(read_until("stopped component=server").find("answered=10000"), std::string::npos);
  EXPECT_EQ(server_->wait(), 0);
}

TEST_F(StalledLog, TheServerStopsAllTheSame) {
  start();
  solve(1000);
  server_->send(SIGTERM);
  EXPECT_EQ(server_->wait(), 0);
}

using HealthyLog = ServiceTest;

TEST_F(HealthyLog, HasEveryLineWhenTheServerHasEnded) {
  start({"--log-lines-per-s", "0"});
  for (int i = 0; i < 300; ++i) EXPECT_TRUE(lives());
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
  EXPECT_EQ(server().log_lines({" job component=job "}).size(), 300U);
  EXPECT_EQ(server().log_lines({" stopped component=server ", "answered=300"}).size(), 1U);
  EXPECT_TRUE(server().log_lines({"dropped="}).empty());
}

}  // namespace
}  // namespace marble::testing
