// What gRPC's channel does by itself: repeat what may be repeated, take turns between healthy servers.
#pragma once

#include <string>

namespace marble::client {

/// As JSON (gRPC's service config). Repeated, at most three times, is what got UNAVAILABLE before any answer
/// and asks for nothing that lasts: solves are pure, looking changes nothing. Not repeated: Submit, Delete,
/// Cancel, sessions and batches, whose first message may have been taken in. With `several` servers calls go
/// round those that say they are healthy.
[[nodiscard]] std::string service_config(bool several);

}  // namespace marble::client
