// Provides W3C Trace Context for the client: the header that it sends, and the one that it receives.
#pragma once

#include <grpcpp/client_context.h>

#include <string>

#include "marble/error.h"
#include "message_text.h"

namespace marble::client {

/// Checks that the text may stand in a header. The server checks whether it is a valid traceparent.
[[nodiscard]] inline Expected<void> check_traceparent(const std::string& text) {
  if (text.size() <= 512 && is_printable(text)) return {};
  return unexpected(invalid("traceparent", "must be at most 512 bytes of printable ASCII"));
}

/// Returns the server's traceparent; empty if there is none. Only valid after the server's initial metadata.
[[nodiscard]] inline std::string returned_traceparent(const grpc::ClientContext& context) {
  const auto& metadata = context.GetServerInitialMetadata();
  const auto found = metadata.find("traceparent");
  return found == metadata.end() ? "" : std::string(found->second.data(), found->second.size());
}

}  // namespace marble::client
