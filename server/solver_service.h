// marble.v1.Solver on gRPC's callback API.
#pragma once

#include "marble/v1/service.grpc.pb.h"
#include "scheduler.h"

namespace marble::server {

class SolverService final : public v1::Solver::CallbackService {
 public:
  SolverService(Scheduler& scheduler, const Log& log) : scheduler_(scheduler), log_(log) {}

  grpc::ServerUnaryReactor* Solve(grpc::CallbackServerContext* context, const v1::SolveRequest* request,
                                  v1::SolveResponse* response) override;
  grpc::ServerWriteReactor<v1::SolveStreamResponse>* SolveStream(
      grpc::CallbackServerContext* context, const v1::SolveStreamRequest* request) override;

 private:
  Scheduler& scheduler_;
  const Log& log_;
};

}  // namespace marble::server
