// Symptom: one message of 10 MB with `grpc-encoding: gzip`, from anybody who reached the port, took 10 GB;
// the server was killed for want of memory. The bound of a message was asked after it had been inflated.
#include "service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

class GzipBomb : public ServiceTest {};

TEST_F(GzipBomb, IsRefusedAtItsHeaders) {
  start();
  const std::int64_t before = resident_bytes(server().pid());
  RawHttp2 raw(server().address());
  raw.begin();
  raw.call(1, "/marble.v1.Solver/Solve", {{"grpc-encoding", "gzip"}});
  EXPECT_TRUE(raw.eventually_ended(1)) << "without a byte of the message";
  EXPECT_LT(resident_bytes(server().pid()) - before, 32 << 20);
}

TEST_F(GzipBomb, AClientThatCompressesIsReportedSo) {
  start();
  grpc::ClientContext context;
  context.set_compression_algorithm(GRPC_COMPRESS_GZIP);
  v1::SolveResponse response;
  const grpc::Status status = solver().Solve(&context, long_request(), &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_NE(status.error_message().find("gzip"), std::string::npos) << status.error_message();
  EXPECT_TRUE(lives());
}

}  // namespace
}  // namespace marble::testing
