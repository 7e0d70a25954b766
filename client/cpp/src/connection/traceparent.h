// W3C Trace Context on the client's side: what is sent, and what came back.
#pragma once

#include <grpcpp/client_context.h>

#include <string>

#include "marble/error.h"
#include "text/printable.h"

namespace marble::client {

/// Whether it may stand in a header. Whether it is one, the server judges.
[[nodiscard]] inline Expected<void> check_traceparent(const std::string& text) {
  if (text.size() <= 512 && is_printable(text)) return {};
  return unexpected(invalid("traceparent", "must be at most 512 bytes of printable ASCII"));
}

/// The server's answer to it; empty if there is none. Only once the server's first word is there.
[[nodiscard]] inline std::string returned_traceparent(const grpc::ClientContext& context) {
  const auto& metadata = context.GetServerInitialMetadata();
  const auto found = metadata.find("traceparent");
  return found == metadata.end() ? "" : std::string(found->second.data(), found->second.size());
}

}  // namespace marble::client
