#include <netinet/in.h>
#include <sys/stat.h>

#include "http_service_test.h"
#include "secure_service_test.h"
#include "service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

// Symptoms: `--listen 0.0.0.0:P` listened on IPv6 too, which a firewall for IPv4 left open. A server
// restarted on the port of one that was still ending failed at once with "in use, or no address of this
// machine".
class Address : public SecureServiceTest {};

TEST_F(Address, OfIpv4ListensOnIpv4Alone) {
  start(
      {"--listen", "0.0.0.0:0", "--insecure", "--tokens", write("tokens", new_token("planner:solve").line)});
  const std::string& address = server().address();
  const int six = socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in6 name = {};
  name.sin6_family = AF_INET6;
  name.sin6_addr = in6addr_loopback;
  name.sin6_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
  EXPECT_NE(::connect(six, reinterpret_cast<const sockaddr*>(&name), sizeof name), 0);
  close(six);
}

TEST_F(Address, OfAServerThatIsStillEndingIsWaitedFor) {
  start();
  const std::string file = directory_.file("next address");
  ChildProcess next({MARBLE_SERVER_BINARY, "--listen", server().address(), "--http", "none", "--address-file",
                     file, "--listen-wait-s", "600"},
                    directory_.file("next log"));
  ASSERT_TRUE(eventually([&] { return next.output().find("address_in_use") != std::string::npos; }))
      << next.output();
  server().terminate();
  EXPECT_TRUE(eventually([&] { return std::filesystem::exists(file); })) << next.output();
  const auto stub = v1::Solver::NewStub(connect(read_file(file).substr(0, read_file(file).find('\n'))));
  grpc::ClientContext context;
  v1::SolveResponse response;
  EXPECT_TRUE(stub->Solve(&context, example_request(), &response).ok());
}

// Symptom: nothing bounded connections, in all or of a host, and nothing closed those that never said a word:
// 5000 silent ones were open for as long as they liked, 3000 with HTTP/2 and no call likewise.
class ConnectionLimits : public HttpServiceTest {
 protected:
  [[nodiscard]] bool eventually_closed_for(const std::string& reason) {
    return eventually_logged({"connection_closed", "reason=\"" + reason + "\""});
  }
};

TEST_F(ConnectionLimits, WhoBringsNothingMakesRoomForOthers) {
  start({"--connections", "8"});
  std::vector<std::unique_ptr<RawHttp2>> silent;
  for (int i = 0; i < 40; ++i) silent.push_back(std::make_unique<RawHttp2>(server().address()));
  EXPECT_TRUE(lives());
  EXPECT_TRUE(silent[0]->eventually_closed());
  EXPECT_TRUE(eventually_closed_for("connections"));
  const std::string metrics = get("/metrics")->body;
  EXPECT_NE(metrics.find("marble_connections_limit 8\n"), std::string::npos) << metrics;
  EXPECT_EQ(metrics.find("marble_connections_closed_total{reason=\"connections\"} 0\n"), std::string::npos);
}

TEST_F(ConnectionLimits, WhoHasACallKeepsItsPlaceAndOneMoreIsRefused) {
  start({"--host-connections", "4"});
  std::vector<std::unique_ptr<v1::Solver::Stub>> stubs;
  std::vector<std::unique_ptr<Stream>> calls;
  for (int i = 0; i < 4; ++i) {
    stubs.push_back(v1::Solver::NewStub(connect(server().address())));
    calls.push_back(std::make_unique<Stream>(*stubs.back(), long_request()));
    ASSERT_TRUE(calls.back()->read_until(Event::kAccepted));
  }
  RawHttp2 one_more(server().address());
  EXPECT_TRUE(one_more.eventually_closed());
  EXPECT_TRUE(eventually_closed_for("host_connections"));
  for (const auto& call : calls) call->cancel();
  for (const auto& call : calls) EXPECT_EQ(call->finish().error_code(), grpc::StatusCode::CANCELLED);
  // Those without a call make room, as soon as the server is done with it.
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  v1::SolveResponse response;
  EXPECT_TRUE(solver().Solve(&context, example_request(), &response).ok());
}

TEST_F(ConnectionLimits, ASilentOneIsClosed) {
  start({"--connection-start-s", "0.1"});
  RawHttp2 silent(server().address());
  EXPECT_TRUE(silent.eventually_closed());
  EXPECT_TRUE(eventually_closed_for("silent"));
}

TEST_F(ConnectionLimits, OneThatBeginsAndGoesNoFurtherIsClosed) {
  start({"--connection-start-s", "0.1"});
  RawHttp2 half(server().address());
  half.send("PRI * HTTP");
  EXPECT_TRUE(half.eventually_closed());
}

TEST_F(ConnectionLimits, OneWithoutACallIsClosed) {
  start({"--connection-idle-s", "1"});
  RawHttp2 idle(server().address());
  idle.begin();
  EXPECT_TRUE(idle.eventually_closed());
}

TEST_F(ConnectionLimits, OfAStrangerNotManyCallsStayOpen) {
  start({"--tokens", write("tokens", new_token("planner:solve").line), "--unauthenticated-bytes", "1048576"});
  RawHttp2 raw(server().address());
  raw.begin();
  // Health is open to all, and its Watch never ends.
  for (std::uint32_t i = 0; i < 500; ++i) {
    if (!raw.call(2 * i + 1, "/grpc.health.v1.Health/Watch")) break;
    raw.send(RawHttp2::frame(RawHttp2::kData, RawHttp2::kEndStream, 2 * i + 1, RawHttp2::message("")));
  }
  EXPECT_TRUE(raw.eventually_closed());
}

// Symptom: a hundred silent connections to a server that may have 64 descriptors, and no new client was ever
// accepted again, not even after they had gone; /readyz said that all was well. gRPC 1.51's listener gives up
// for ever at the first "Too many open files" (CVE-2023-4785).
class LostListener : public ::testing::Test {
 protected:
  LostListener() {
    const std::string script = directory_.file("few");
    std::ofstream(script) << "#!/bin/sh\nulimit -n 64\nexec '" MARBLE_SERVER_BINARY "' \"$@\"\n";
    chmod(script.c_str(), 0700);
    server_ = std::make_unique<ServerProcess>(script, std::vector<std::string>{"--workers", "1"});
  }
  [[nodiscard]] grpc::Status solve(v1::Solver::Stub& stub) {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::SolveResponse response;
    return stub.Solve(&context, example_request(), &response);
  }
  [[nodiscard]] grpc::Status solve_anew() {
    const auto stub = v1::Solver::NewStub(connect(server_->address()));
    return solve(*stub);
  }

  TemporaryDirectory directory_;
  std::unique_ptr<ServerProcess> server_;
};

TEST_F(LostListener, NewClientsAreAcceptedWhileAndAfterDescriptorsAreShort) {
  const auto old = v1::Solver::NewStub(connect(server_->address()));
  ASSERT_TRUE(solve(*old).ok());
  {
    std::vector<std::unique_ptr<RawHttp2>> silent;
    for (int i = 0; i < 100; ++i) silent.push_back(std::make_unique<RawHttp2>(server_->address()));
    EXPECT_TRUE(eventually([&] { return !server_->log_lines({"connection_closed"}).empty(); }))
        << server_->log();
    EXPECT_TRUE(solve_anew().ok()) << server_->log();
    EXPECT_TRUE(solve(*old).ok());
  }
  EXPECT_TRUE(solve_anew().ok()) << server_->log();
}

// Symptom: the listener of the gRPC port was dead, and /readyz said 200: nothing restarted the server. What
// it asks is tested in tests/server/base_test.cpp; here that a server that is well says so, at
// whatever it listens.
class Ready : public HttpServiceTest {};

TEST_F(Ready, AsksEveryAddressOfTheServer) {
  start({"--listen", "127.0.0.1:0", "--listen", "localhost:0", "--listen",
         "unix:" + directory_.file("socket")});
  const auto ready = get("/readyz");
  EXPECT_EQ(ready->status, 200) << ready->body;
}

TEST_F(Ready, AsksWithTlsToo) {
  TestAuthority authority;
  start(tls_flags(authority.issue_for_server()));
  httplib::Client client(server().http());
  client.enable_server_certificate_verification(false);
  const auto ready = client.Get("/readyz");
  ASSERT_TRUE(ready);
  EXPECT_EQ(ready->status, 200) << ready->body;
}

}  // namespace
}  // namespace marble::testing
