// Converts gRPC statuses to errors; the only place that does.
#pragma once

#include <grpcpp/support/status.h>

#include <chrono>
#include <optional>
#include <stop_token>

#include "google/rpc/status.pb.h"
#include "marble/error.h"

namespace marble::client {

/// Converts code, message and the Fault or, from an older server, the BadRequest; problem fields get their
/// names in core ("A.row_indices").
[[nodiscard]] Error to_error(const grpc::Status& status);
/// The same for a status inside a stream, which continues.
[[nodiscard]] Error to_error(const google::rpc::Status& status);

/// Returns after how long a retry may succeed, if the request was refused for lack of capacity; nothing if
/// waiting does not help.
[[nodiscard]] std::optional<std::chrono::duration<double>> retry_after(const google::rpc::Status& status);
[[nodiscard]] std::optional<std::chrono::duration<double>> retry_after(const grpc::Status& status);

/// The same; the error says that the caller cancelled, if it did.
[[nodiscard]] Error to_error(const grpc::Status& status, const std::stop_token& stop);

}  // namespace marble::client
