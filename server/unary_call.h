// Quick unary calls: parse, ask, answer, all on gRPC's thread.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <new>

#include "origin.h"
#include "status.h"
#include "wire.h"

namespace marble::server {

/// `handle` takes the request, fills the response and completes the origin, or says why not.
template <class Request, class Response, class Handle>
grpc::ServerUnaryReactor* answer(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request_bytes,
                                 grpc::ByteBuffer* response_bytes, const Handle& handle,
                                 double retry_delay_s = 0.0) {
  Origin origin = origin_of(*context);
  Request request;
  Response response;
  Expected<void> handled = parse(request_bytes, &request);
  try {
    if (handled) handled = handle(request, &response, origin);
    if (handled) *response_bytes = serialize(response);
  } catch (const std::bad_alloc&) {
    handled = unexpected(Error{ErrorCode::resource_exhausted, "", -1, "", "the server is out of memory"});
  }
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(handled ? grpc::Status::OK : to_status(handled.error(), retry_delay_s));
  return reactor;
}

}  // namespace marble::server
