// The log of a real server: whose a line is, which lines there are, and that no client floods it.
#include <sys/socket.h>
#include <unistd.h>

#include <map>
#include <nlohmann/json.hpp>

#include "bidi.h"
#include "secure_service_test.h"
#include "support/loopback.h"

namespace marble::testing {
namespace {

using Json = nlohmann::json;

class LogLines : public SecureServiceTest {
 protected:
  /// One solve as a client that calls itself so.
  grpc::Status solve_as(const std::string& client, const v1::SolveRequest& request,
                        const Metadata& metadata = {}) {
    grpc::ClientContext context;
    context.AddMetadata("marble-client", client);
    for (const auto& [key, value] : metadata) context.AddMetadata(key, value);
    v1::SolveResponse response;
    return solver().Solve(&context, request, &response);
  }
  void stop() {
    server().terminate();
    EXPECT_EQ(server().wait(), 0);
  }
  /// All of the log, which is JSON; lines that are none fail the test.
  [[nodiscard]] std::vector<Json> lines() {
    std::vector<Json> result;
    for (const std::string& text : server().log_lines({})) {
      const Json line = Json::parse(text, nullptr, false);
      EXPECT_TRUE(line.is_object()) << text;
      if (line.is_object()) result.push_back(line);
    }
    return result;
  }
  /// Lines of an event of one client, and how many more there would have been.
  struct Reported {
    int lines = 0, suppressed = 0;
  };
  [[nodiscard]] Reported reported(const std::string& event, const std::string& client) {
    Reported result;
    for (const Json& line : lines()) {
      if (line.value("client", "") != client) continue;
      const bool itself = line["event"] == event;
      const bool summary = line["event"] == "suppressed" && line["of"] == event;
      result.lines += itself ? 1 : 0;
      result.suppressed += itself || summary ? line.value("suppressed", 0) : 0;
    }
    return result;
  }
  /// Writes bytes to the server's port and hangs up.
  void send_garbage(const std::string& bytes) {
    const int connection = connected_to(server().address());
    EXPECT_EQ(::write(connection, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
    shutdown(connection, SHUT_WR);
    char answer = 0;
    while (read(connection, &answer, 1) > 0) {
    }
    close(connection);
  }
};

TEST_F(LogLines, AFloodOfRefusalsGivesFewLinesThatAddUp) {
  start({"--log-format", "json", "--log-lines-per-s", "5"});
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 500; ++i) EXPECT_FALSE(solve_as("flood", {}).ok());
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(solve_as("other", {}).ok());
  const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  stop();
  const Reported flood = reported("refused", "flood");
  EXPECT_GE(flood.lines, 5);
  EXPECT_LE(flood.lines, 6 + 5 * took_s);
  EXPECT_EQ(flood.lines + flood.suppressed, 500);
  const Reported other = reported("refused", "other");
  EXPECT_EQ(other.lines, 3) << "a flood takes nothing from others";
  EXPECT_EQ(other.suppressed, 0);
}

TEST_F(LogLines, WhatWasHeldBackIsReportedWhileTheServerRuns) {
  start({"--log-lines-per-s", "1"});
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(solve_as("flood", {}).ok());
  EXPECT_TRUE(
      eventually_logged({"suppressed component=admission of=\"refused\" client=\"flood\" suppressed="}));
}

TEST_F(LogLines, AFloodOfSmallSolvesAddsUpToo) {
  start({"--log-format", "json", "--log-lines-per-s", "2"});
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(solve_as("busy", example_request()).ok());
  stop();
  const Reported busy = reported("job", "busy");
  EXPECT_GE(busy.suppressed, 1);
  EXPECT_EQ(busy.lines + busy.suppressed, 100);
}

TEST_F(LogLines, WrongTokensAreReportedByHostAndLimited) {
  start({"--log-lines-per-s", "1", "--tokens", write("tokens", new_token("planner:solve").line)});
  for (int i = 0; i < 30; ++i) EXPECT_FALSE(ask(bearer("wrong")).ok());
  EXPECT_TRUE(eventually_logged({"refused component=access", "unauthenticated"})) << server().log();
  EXPECT_TRUE(eventually_logged({"suppressed component=access of=\"refused\" client=\"127.0.0.1\""}))
      << server().log();
}

TEST_F(LogLines, EachSaysWhoseItIs) {
  start({"--log-format", "json", "--log-levels", "session=debug"});
  v1::SolveRequest request = example_request();
  request.set_request_id("tick 17");
  EXPECT_TRUE(solve_as("planner", request).ok());
  request.mutable_problem()->clear_gradient();
  EXPECT_FALSE(solve_as("planner", request).ok());
  {
    Bidi<v1::SessionRequest, v1::SessionResponse> session(
        [this](grpc::ClientContext* context) { return solver().Session(context); });
    v1::SessionRequest setup;
    *setup.mutable_setup()->mutable_problem() = example_request().problem();
    setup.mutable_setup()->set_request_id("loop 1");
    ASSERT_TRUE(session.write(setup));
    ASSERT_TRUE(session.next().value_or(v1::SessionResponse()).has_ready());
    v1::SessionRequest update;
    update.mutable_update()->set_sequence(1);
    ASSERT_TRUE(session.write(update));
    ASSERT_TRUE(session.next().value_or(v1::SessionResponse()).has_answer());
    session.done();
    EXPECT_TRUE(session.finish().ok());
  }
  stop();
  std::map<std::string, std::string> request_of;
  for (const Json& line : lines()) {
    EXPECT_TRUE(line.contains("time") && line.contains("level") && line.contains("component")) << line;
    if (!line.contains("request")) continue;
    request_of[line["event"]] = line["request"];
    EXPECT_EQ(line.contains("job"), line["event"] != "refused") << line;
    EXPECT_FALSE(line.contains("trace_id")) << "nobody sent one: " << line;
  }
  const std::map<std::string, std::string> expected = {{"job", "tick 17"},
                                                       {"refused", "tick 17"},
                                                       {"session", "loop 1"},
                                                       {"session_open", "loop 1"},
                                                       {"update", "loop 1"}};
  EXPECT_EQ(request_of, expected);
}

TEST_F(LogLines, LevelsAreByComponentAndCanBeReloaded) {
  write("config.toml", "log_level = \"error\"\nlog_levels = \"server=info\"\n");
  start({"--config", directory_.file("config.toml")});
  EXPECT_TRUE(solve_as("before", example_request()).ok());
  write("config.toml", "log_level = \"error\"\nlog_levels = \"server=info,job=info\"\n");
  server().send(SIGHUP);
  ASSERT_TRUE(eventually_logged({"reloaded", "log_levels"})) << server().log();
  EXPECT_TRUE(solve_as("after", example_request()).ok());
  EXPECT_FALSE(solve_as("after", {}).ok());
  EXPECT_TRUE(eventually_logged({"job component=job", "client=\"after\""})) << server().log();
  EXPECT_TRUE(server().log_lines({"client=\"before\""}).empty()) << server().log();
  EXPECT_TRUE(server().log_lines({"refused"}).empty()) << server().log();
}

TEST_F(LogLines, ALevelOfNothingIsAFaultThatNamesIt) {
  const Run reported = run({"--check-config", "--log-levels", "sessions=debug"});
  EXPECT_EQ(reported.exit_code, 2);
  EXPECT_TRUE(reported.said("flag --log-levels: log_levels = sessions: must be one of server, "))
      << reported.output;
}

TEST_F(LogLines, WhatGrpcHasToSayIsALineOfOurs) {
  TestAuthority authority;
  auto flags = tls_flags(authority.issue_for_server());
  flags.insert(flags.end(), {"--log-format", "json", "--log-lines-per-s", "1"});
  start(flags);
  for (int i = 0; i < 20; ++i) send_garbage("no handshake\n{\"event\":\"forged\"}\r\n\r\n");
  ASSERT_TRUE(eventually_logged({"\"component\":\"grpc\"", "\"message\":"})) << server().log();
  ASSERT_TRUE(eventually_logged({"\"component\":\"grpc\"", "\"suppressed\":"})) << server().log();
  stop();
  for (const Json& line : lines()) EXPECT_NE(line["event"], "forged");
}

TEST_F(LogLines, TextOfClientsStaysOnItsLine) {
  start({"--log-format", "json"});
  const std::string evil = "x\n{\"event\":\"forged\"}\r\x1b[2J\"\\\xe2\x80\xa8";
  v1::SolveRequest request = example_request();
  request.mutable_problem()->set_name(evil);
  EXPECT_TRUE(solve_as("a \"client\" event=forged", request).ok());
  request.set_request_id(evil);
  EXPECT_FALSE(solve_as("planner", request, {{"traceparent", "\"} event=forged"}}).ok());
  stop();
  for (const Json& line : lines()) EXPECT_NE(line["event"], "forged");
  EXPECT_EQ(server().log().find('\x1b'), std::string::npos);
}

TEST_F(LogLines, NumbersOfProblemsAreNotLogged) {
  start({"--log-level", "debug"});
  v1::SolveRequest request = example_request();
  request.mutable_problem()->set_gradient(0, 98765.4321);
  request.mutable_initial_point()->add_z(12345.6789);  // refused: one is too few
  EXPECT_FALSE(solve_as("planner", request).ok());
  request.clear_initial_point();
  EXPECT_TRUE(solve_as("planner", request).ok());
  ASSERT_TRUE(eventually_logged({"job component=job"}));
  for (const char* number : {"98765", "12345.6"})
    EXPECT_EQ(server().log().find(number), std::string::npos) << server().log();
}

}  // namespace
}  // namespace marble::testing
