// Symptom: a hundred silent connections to a server that may have 64 descriptors, and no new client was ever
// accepted again, not even after they had gone; /readyz said that all was well. gRPC 1.51's listener gives up
// for ever at the first "Too many open files" (CVE-2023-4785).
#include <sys/stat.h>

#include "service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
