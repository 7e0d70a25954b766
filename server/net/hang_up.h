// The end of the gRPC server: every call that it has begun to read is answered, every other is told to its
// client as one that was not seen.
#pragma once

#include "net/connection_table.h"
#include "net/listen.h"
#include "net/live_calls.h"

namespace marble::server {

/// After a drain. Returns when all connections are closed, within some eight seconds whatever clients do.
void hang_up(const Listening& listening, ConnectionTable& connections, LiveCalls& calls);

}  // namespace marble::server
