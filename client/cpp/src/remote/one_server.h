// Checks the connection of calls about jobs.
#pragma once

#include "connection/connection.h"
#include "in_process/in_process.h"

namespace marble::client {

/// A job stays with the server that accepted it: with rotation, all other servers would not find it. Null
/// means a client in process. Errors: unavailable (there is no server), invalid_argument (there are several).
[[nodiscard]] inline Expected<void> one_server(const Connection* connection) {
  if (connection == nullptr) return unexpected(no_server());
  if (!connection->several()) return {};
  return unexpected(invalid("address", "\"" + connection->address() + "\"",
                            "must be of one server: jobs stay with the one that took them"));
}

}  // namespace marble::client
