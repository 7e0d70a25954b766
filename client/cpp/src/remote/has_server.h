// Checks the connection of calls that only servers have.
#pragma once

#include "connection/connection.h"
#include "in_process/in_process.h"

namespace marble::client {

/// Null means a client in process. Errors: unavailable (there is no server).
[[nodiscard]] inline Expected<void> has_server(const Connection* connection) {
  if (connection == nullptr) return unexpected(no_server());
  return {};
}

}  // namespace marble::client
