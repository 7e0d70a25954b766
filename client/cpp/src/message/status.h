// The one place where gRPC statuses become errors.
#pragma once

#include <grpcpp/support/status.h>

#include <chrono>
#include <optional>
#include <stop_token>

#include "google/rpc/status.pb.h"
#include "marble/error.h"

namespace marble::client {

/// Reads code, message and the Fault or, of an older server, the BadRequest; problem fields get their core
/// names back ("A.row_indices").
[[nodiscard]] Error to_error(const grpc::Status& status);
/// The same of a status inside a stream, which goes on.
[[nodiscard]] Error to_error(const google::rpc::Status& status);

/// After how long another try may have room, where that is why it was refused; nothing where no wait helps.
[[nodiscard]] std::optional<std::chrono::duration<double>> retry_after(const google::rpc::Status& status);

/// Says that it was the caller who gave up, where that is so.
[[nodiscard]] Error to_error(const grpc::Status& status, const std::stop_token& stop);

}  // namespace marble::client
