// marble.v1.Solver on gRPC's callback API.
#pragma once

#include "marble/v1/service.grpc.pb.h"
#include "service_parts.h"

namespace marble::server {

/// The methods take and give bytes; see wire.h.
class SolverService final : public v1::Solver::WithRawCallbackMethod_Solve<
                                v1::Solver::WithRawCallbackMethod_SolveStream<v1::Solver::Service>> {
 public:
  SolverService(Scheduler& scheduler, const Log& log) : parts_{scheduler, log, calls_} {}

  /// Waits until every answer is sent, or for `limit`.
  void wait_for_answers(std::chrono::steady_clock::duration limit) { calls_.wait_for_none(limit); }

  grpc::ServerUnaryReactor* Solve(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                  grpc::ByteBuffer* response) override;
  grpc::ServerWriteReactor<grpc::ByteBuffer>* SolveStream(grpc::CallbackServerContext* context,
                                                          const grpc::ByteBuffer* request) override;

 private:
  LiveCalls calls_;
  const ServiceParts parts_;
};

}  // namespace marble::server
