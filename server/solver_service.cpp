#include "solver_service.h"

#include "solve_call.h"
#include "solve_stream.h"

namespace marble::server {

grpc::ServerUnaryReactor* SolverService::Solve(grpc::CallbackServerContext* context,
                                               const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  return SolveCall::begin(parts_, *context, request, response);
}

grpc::ServerWriteReactor<grpc::ByteBuffer>* SolverService::SolveStream(grpc::CallbackServerContext* context,
                                                                       const grpc::ByteBuffer* request) {
  return SolveStreamCall::begin(parts_, *context, request);
}

}  // namespace marble::server
