// Shuts down the gRPC server: every call that it has begun to read gets a reply, and every other is reported
// to its client as not seen.
#pragma once

#include "net/connection_table.h"
#include "net/listen.h"
#include "net/live_calls.h"

namespace marble::server {

/// Called after a drain. Returns when all connections are closed, within about eight seconds regardless of
/// clients.
void hang_up(const Listening& listening, ConnectionTable& connections, LiveCalls& calls);

}  // namespace marble::server
