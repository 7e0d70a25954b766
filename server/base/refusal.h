// The reasons for refusing a request, as a bounded set: the limit that was reached, else the error's code.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "marble/error.h"

namespace marble::server {

/// Limits that refuse with resource_exhausted, by the name in the error: settings, and a job's own deadline.
constexpr std::array kRefusingLimits = {"queue_jobs", "queue_bytes",     "client_queued", "client_bytes",
                                        "sessions",   "client_sessions", "session_bytes", "deadline"};
constexpr std::size_t kRefusalReasons =
    kRefusingLimits.size() + static_cast<std::size_t>(ErrorCode::internal) + 1;

/// In [0, kRefusalReasons).
[[nodiscard]] inline std::size_t refusal_reason(const Error& error) {
  if (error.code == ErrorCode::resource_exhausted) {
    const auto* const limit = std::find(kRefusingLimits.begin(), kRefusingLimits.end(), error.field);
    if (limit != kRefusingLimits.end()) return static_cast<std::size_t>(limit - kRefusingLimits.begin());
  }
  return kRefusingLimits.size() + static_cast<std::size_t>(error.code);
}

/// Returns the error for requests to a server that stops.
[[nodiscard]] inline Error draining(const char* advice = "retry elsewhere") {
  return failure(ErrorCode::unavailable, std::string("the server is draining; ") + advice);
}

[[nodiscard]] inline const char* refusal_name(std::size_t reason) {
  return reason < kRefusingLimits.size() ? kRefusingLimits[reason]
                                         : to_string(static_cast<ErrorCode>(reason - kRefusingLimits.size()));
}

}  // namespace marble::server
