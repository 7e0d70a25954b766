// The one place where gRPC statuses become errors.
#pragma once

#include <grpcpp/support/status.h>

#include "marble/error.h"

namespace marble::client {

/// Reads code, message and the BadRequest detail; problem fields get their core names back ("A.row_indices").
[[nodiscard]] Error to_error(const grpc::Status& status);

}  // namespace marble::client
