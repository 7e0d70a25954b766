// marble.v1.Solver on gRPC's callback API.
#pragma once

#include "marble/v1/service.grpc.pb.h"
#include "scheduler.h"

namespace marble::server {

/// The methods take and give bytes; see wire.h.
class SolverService final : public v1::Solver::WithRawCallbackMethod_Solve<
                                v1::Solver::WithRawCallbackMethod_SolveStream<v1::Solver::Service>> {
 public:
  SolverService(Scheduler& scheduler, const Log& log) : scheduler_(scheduler), log_(log) {}

  grpc::ServerUnaryReactor* Solve(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                  grpc::ByteBuffer* response) override;
  grpc::ServerWriteReactor<grpc::ByteBuffer>* SolveStream(grpc::CallbackServerContext* context,
                                                          const grpc::ByteBuffer* request) override;

 private:
  Scheduler& scheduler_;
  const Log& log_;
};

}  // namespace marble::server
