// The only place where errors become gRPC statuses.
#pragma once

#include <grpcpp/support/status.h>

#include "google/rpc/status.pb.h"
#include "marble/error.h"

namespace marble::server {

/// True if the same request may succeed later.
[[nodiscard]] bool retry_may_help(ErrorCode code);

/// Returns the text in a form that a message can contain: bytes that are not UTF-8 become question marks.
[[nodiscard]] std::string utf8(const std::string& text);

/// Returns the error with only the first 64 bytes of its value and their total number: a value is a client's
/// text, and trailers are limited to 8 kB.
[[nodiscard]] Error abridged(Error error);
/// Returns the error, abridged, with its details: Fault if it has a field; BadRequest with field path and
/// rule, in prose, for invalid_argument; RetryInfo for resource_exhausted and unavailable if waiting helps:
/// if `retry_delay_s` > 0.
[[nodiscard]] google::rpc::Status to_message(const Error& error, double retry_delay_s = 0.0);
/// The inverse, for statuses that the server itself has written.
[[nodiscard]] Error error_of(const google::rpc::Status& status);
/// The same as the status of a call.
[[nodiscard]] grpc::Status to_status(const Error& error, double retry_delay_s = 0.0);

}  // namespace marble::server
