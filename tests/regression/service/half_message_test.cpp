// Symptom: streams that announced 256 MiB, sent 250 MB and stalled took that memory for as long as they
// liked, without credentials: 6 of them 1.6 GB, 30 killed the server. gRPC reads the message of a unary
// method before it shows the call, so that nobody had asked who called.
#include "secure_service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

const std::vector<std::string> kOneMessageMethods = {
    "Solver/Solve", "Solver/SolveStream", "Jobs/Submit", "Jobs/Result", "Jobs/Delete",
    "Jobs/List",    "Jobs/Get",           "Jobs/Cancel", "Jobs/Watch",  "Jobs/Bundle"};

class HalfMessage : public SecureServiceTest {};

TEST_F(HalfMessage, ACallerWhoIsNotKnownIsRefusedBeforeItIsRead) {
  start({"--tokens", write("tokens", new_token("planner:solve").line)});
  RawHttp2 raw(server().address());
  raw.begin();
  std::uint32_t stream = 1;
  for (const std::string& method : kOneMessageMethods) {
    raw.call(stream, "/marble.v1." + method);
    EXPECT_TRUE(raw.eventually_ended(stream)) << method;
    EXPECT_FALSE(raw.is_closed()) << method;
    stream += 2;
  }
}

TEST_F(HalfMessage, OfWhatIsOpenToAllNotMuchIsTaken) {
  start();
  RawHttp2 raw(server().address());
  raw.begin();
  // Reset as soon as it is begun, so that flow control lets the next begin: what came remains to be
  // explained.
  const std::string half = RawHttp2::message(std::string(60'000, '\0'), 200 << 20);
  std::int64_t sent = 0;
  for (std::uint32_t stream = 1; sent < 1 << 30; stream += 2) {
    if (!raw.call(stream, "/grpc.health.v1.Health/Check") ||
        !raw.send(RawHttp2::frame(RawHttp2::kData, RawHttp2::kNone, stream, half)))
      break;
    sent += 16'000;
  }
  EXPECT_LT(sent, 1 << 30);
  EXPECT_LT(resident_bytes(server().pid()), 512 << 20);
  EXPECT_TRUE(lives());
}

TEST_F(HalfMessage, AWholeOneOfOneWhoIsKnownPassesHoweverLarge) {
  const Token planner = new_token("planner:solve");
  start({"--tokens", write("tokens", planner.line)});
  v1::SolveRequest request = example_request();
  request.mutable_initial_point()->mutable_z()->Resize(13'000'000, 0.0);  // 104 MB, all of a wrong size
  grpc::ClientContext context;
  context.AddMetadata("authorization", "Bearer " + planner.secret);
  v1::SolveResponse response;
  const grpc::Status status = solver().Solve(&context, request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
  EXPECT_EQ(bad_field(status).field(), "initial_point.z");
  EXPECT_TRUE(server().log_lines({"connection_closed"}).empty()) << server().log();
}

}  // namespace
}  // namespace marble::testing
