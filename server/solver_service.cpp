#include "solver_service.h"

#include "batch_call.h"
#include "read_first.h"
#include "session_call.h"
#include "solve_call.h"
#include "solve_stream.h"

namespace marble::server {

SolverService::SolverService(const ServiceParts& parts) : parts_(parts) {
  MarkMethodStreamed(method_number("Solver", "Solve"),
                     unary_read_first(parts, [this](auto... given) { return Solve(given...); }));
  MarkMethodStreamed(method_number("Solver", "SolveStream"),
                     stream_read_first(parts, [this](auto... given) { return SolveStream(given...); }));
}

grpc::ServerUnaryReactor* SolverService::Solve(grpc::CallbackServerContext* context,
                                               const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  return SolveCall::begin(parts_, *context, request, response);
}

grpc::ServerWriteReactor<grpc::ByteBuffer>* SolverService::SolveStream(grpc::CallbackServerContext* context,
                                                                       const grpc::ByteBuffer* request) {
  return SolveStreamCall::begin(parts_, *context, request);
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
