// Where a request comes from, as far as it is known yet, for log lines and traces.
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

/// Returns the host of gRPC's peer: "ipv4:127.0.0.1:4711" → "127.0.0.1", "ipv6:%5B::1%5D:4711" → "::1".
/// Without the port, which differs for every connection of a client.
[[nodiscard]] std::string host_of(const std::string& peer);

/// Reads the client's trace, and returns its continuation in the call's initial metadata: `traceparent` with
/// the server's own span, and `tracestate` unchanged. Called once per call, before anything is sent.
[[nodiscard]] Origin origin_of(grpc::CallbackServerContext& context);

}  // namespace marble::server
