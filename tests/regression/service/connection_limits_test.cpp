// Symptom: nothing bounded connections, in all or of a host, and nothing closed those that never said a word:
// 5000 silent ones were open for as long as they liked, 3000 with HTTP/2 and no call likewise.
#include "http_service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
