// Symptom: a thousand calls of Jobs.Result for one kept answer of 4 MB, on a connection that read none of
// them, took 3.9 GB for as long as it liked: each call had a copy of its own.
#include "http_service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

class KeptAnswer : public HttpServiceTest {};

TEST_F(KeptAnswer, IsHeldOnceForAllWhoAskForIt) {
  start();
  constexpr int kVariables = 500'000;
  constexpr int kCalls = 1000;
  v1::SolveRequest request;
  v1::Problem& problem = *request.mutable_problem();
  problem.mutable_gradient()->Resize(kVariables, -1.0);
  v1::SparseMatrix& hessian = *problem.mutable_hessian();
  hessian.set_rows(kVariables);
  hessian.set_columns(kVariables);
  for (int i = 0; i < kVariables; ++i) {
    hessian.add_column_pointers(i);
    hessian.add_row_indices(i);
    hessian.add_values(2.0);
  }
  hessian.add_column_pointers(kVariables);
  const auto jobs = v1::Jobs::NewStub(channel());
  v1::SubmitResponse submitted;
  {
    grpc::ClientContext context;
    ASSERT_TRUE(jobs->Submit(&context, request, &submitted).ok());
  }
  v1::JobResultRequest wanted;
  wanted.set_job_id(submitted.job_id());
  wanted.set_wait(true);
  {
    grpc::ClientContext context;
    v1::SolveResponse response;
    ASSERT_TRUE(jobs->Result(&context, wanted, &response).ok());
    ASSERT_GT(response.ByteSizeLong(), 4'000'000U);
  }
  const std::int64_t before = resident_bytes(server().pid(), "VmRSS");
  RawHttp2 raw(server().address());
  raw.begin();
  for (std::uint32_t i = 0; i < kCalls; ++i) {
    raw.call(2 * i + 1, "/marble.v1.Jobs/Result");
    raw.send(RawHttp2::frame(RawHttp2::kData, RawHttp2::kEndStream, 2 * i + 1,
                             RawHttp2::message(wanted.SerializeAsString())));
  }
  const std::string all_reported =
      "marble_rpcs_total{code=\"OK\",method=\"marble.v1.Jobs/Result\"} " + std::to_string(kCalls + 1);
  ASSERT_TRUE(eventually([&] { return get("/metrics")->body.find(all_reported) != std::string::npos; }));
  EXPECT_LT(resident_bytes(server().pid(), "VmRSS") - before, 256 << 20);
  EXPECT_TRUE(lives());
}

}  // namespace
}  // namespace marble::testing
