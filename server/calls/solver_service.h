// The service marble.v1.Solver on gRPC's callback API.
#pragma once

#include "marble/v1/service.grpc.pb.h"
#include "service/service_parts.h"

namespace marble::server {

using SolverRawService = v1::Solver::WithRawCallbackMethod_Solve<
    v1::Solver::WithRawCallbackMethod_SolveStream<v1::Solver::WithRawCallbackMethod_SolveScenarios<
        v1::Solver::WithRawCallbackMethod_SolveCoupled<v1::Solver::WithRawCallbackMethod_SolveBatch<
            v1::Solver::WithRawCallbackMethod_Session<v1::Solver::Service>>>>>>;

/// The methods read and write bytes; see wire.h.
class SolverService final : public SolverRawService {
 public:
  explicit SolverService(const ServiceParts& parts);

  grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* SolveBatch(
      grpc::CallbackServerContext* context) override;
  grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* Session(
      grpc::CallbackServerContext* context) override;

 private:
  const ServiceParts& parts_;
};

}  // namespace marble::server
