// W3C Trace Context: continues a client's trace in the server's log and replies.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace marble::server {

/// A request's position in its client's trace. Ids are lower-case hexadecimal.
struct TraceContext {
  std::string trace_id;        ///< 32 digits
  std::string parent_span_id;  ///< 16 digits: the client's span
  std::string span_id;         ///< 16 digits: the server's own
  std::uint8_t flags = 0;      ///< sampled (1) and random (2); others are cleared, as the standard requires
};

/// Reads a `traceparent`. Empty if it is invalid by https://www.w3.org/TR/trace-context/, which requires
/// ignoring it; of a later version only the parts known here count.
[[nodiscard]] std::optional<TraceContext> parse_traceparent(std::string_view text, std::string span_id);

/// Returns the `traceparent` for calls made by the server's span, or for clients that look for it.
[[nodiscard]] std::string to_traceparent(const TraceContext& trace);

}  // namespace marble::server
