// The one place where errors become gRPC statuses.
#pragma once

#include <grpcpp/support/status.h>

#include "google/rpc/status.pb.h"
#include "marble/error.h"

namespace marble::server {

/// Whether the same request may be taken later.
[[nodiscard]] bool retry_may_help(ErrorCode code);

/// The text as a message can hold it: bytes that are not UTF-8 become question marks.
[[nodiscard]] std::string utf8(const std::string& text);

/// The error with no more of its value than its first 64 bytes and how many there are: a value is a client's
/// text, and trailers hold 8 kB.
[[nodiscard]] Error abridged(Error error);
/// The error, abridged, with its details: Fault where it has a field; BadRequest with field path and rule, in
/// prose, for invalid_argument; RetryInfo for resource_exhausted and unavailable where waiting helps: where
/// `retry_delay_s` > 0.
[[nodiscard]] google::rpc::Status to_message(const Error& error, double retry_delay_s = 0.0);
/// The way back, of what the server itself has written.
[[nodiscard]] Error error_of(const google::rpc::Status& status);
/// The same as a call's end has it.
[[nodiscard]] grpc::Status to_status(const Error& error, double retry_delay_s = 0.0);

}  // namespace marble::server
