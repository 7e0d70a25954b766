// What calls about jobs ask of a client's connection.
#pragma once

#include "connection/connection.h"
#include "in_process/in_process.h"

namespace marble::client {

/// A job stays with the server that took it: in turns, all but one would say that they never heard of it.
/// Null is a client in process. Errors: unavailable (there is no server), invalid_argument (there are
/// several).
[[nodiscard]] inline Expected<void> one_server(const Connection* connection) {
  if (connection == nullptr) return unexpected(no_server());
  if (!connection->several()) return {};
  return unexpected(invalid("address", "\"" + connection->address() + "\"",
                            "must be of one server: jobs stay with the one that took them"));
}

}  // namespace marble::client
