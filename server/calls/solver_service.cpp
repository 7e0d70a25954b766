#include "calls/solver_service.h"

#include "calls/batch_call.h"
#include "calls/session_call.h"
#include "calls/solve_call.h"
#include "calls/solve_stream.h"
#include "service/read_first.h"

namespace marble::server {

SolverService::SolverService(const ServiceParts& parts) : parts_(parts) {
  MarkMethodStreamed(method_number("Solver", "Solve"),
                     unary_read_first(parts, [&parts](auto* context, auto... bytes) {
                       return SolveCall::begin(parts, *context, bytes...);
                     }));
  MarkMethodStreamed(method_number("Solver", "SolveStream"),
                     stream_read_first(parts, [&parts](auto* context, const auto* request) {
                       return SolveStreamCall::begin(parts, *context, request, {});
                     }));
  MarkMethodStreamed(
      method_number("Solver", "SolveCoupled"),
      stream_read_first(parts, [&parts](auto* context, const auto* request) {
        return SolveStreamCall::begin(parts, *context, request, {"coupled", &v1::SolveRequest::has_coupled});
      }));
  MarkMethodStreamed(method_number("Solver", "SolveScenarios"),
                     stream_read_first(parts, [&parts](auto* context, const auto* request) {
                       return SolveStreamCall::begin(parts, *context, request,
                                                     {"scenarios", &v1::SolveRequest::has_scenarios});
                     }));
}

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* SolverService::SolveBatch(
    grpc::CallbackServerContext* context) {
  return BatchCall::begin(parts_, *context);
}

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* SolverService::Session(
    grpc::CallbackServerContext* context) {
  return SessionCall::begin(parts_, *context);
}

}  // namespace marble::server
