// W3C Trace Context: a client's trace goes on in the server's log and answers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace marble::server {

/// Where a request stands in its client's trace. Ids are lower-case hexadecimal.
struct TraceContext {
  std::string trace_id;        ///< 32 digits
  std::string parent_span_id;  ///< 16 digits: the client's span
  std::string span_id;         ///< 16 digits: the server's own
  std::uint8_t flags = 0;      ///< sampled (1) and random (2); all others are cleared, as the standard asks
};

/// Reads a `traceparent`. Nothing if it is none by https://www.w3.org/TR/trace-context/, which asks to ignore
/// it then; of a later version only what this one knows counts.
[[nodiscard]] std::optional<TraceContext> parse_traceparent(std::string_view text, std::string span_id);

/// The `traceparent` of what the server's span calls, or of who looks for it.
[[nodiscard]] std::string to_traceparent(const TraceContext& trace);

}  // namespace marble::server
