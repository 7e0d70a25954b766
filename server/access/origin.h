// Where a request comes from, as far as it is known yet: what log lines and traces say of it.
#pragma once

#include <grpcpp/server_context.h>

#include <optional>
#include <string>

#include "base/trace_context.h"

namespace marble::server {

struct Origin {
  std::string peer;                        ///< gRPC's address
  std::string client = {};                 ///< empty until it is known
  std::string request_id = {};             ///< as the client gave it; empty until it is known
  std::optional<TraceContext> trace = {};  ///< if the client sent a valid `traceparent`
};

/// Takes up the client's trace, and tells it in the call's initial metadata where that goes on: `traceparent`
/// with a span of the server's own, and `tracestate` as it came. Once a call, before anything is sent.
[[nodiscard]] Origin origin_of(grpc::CallbackServerContext& context);

}  // namespace marble::server
