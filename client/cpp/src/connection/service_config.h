// What gRPC's channel does by itself: repeat what may be repeated, take turns between healthy servers.
#pragma once

#include <string>

namespace marble::client {

/// As JSON (gRPC's service config). Repeated, at most three times, is what got UNAVAILABLE before any answer
/// and is the same when it is asked twice: solves are pure, looking changes nothing, a submission is one job
/// by its request id. Not repeated: Delete, Cancel, sessions and batches, whose first message may have been
/// taken in. With `several` servers calls go round those that say they are healthy.
[[nodiscard]] std::string service_config(bool several);

}  // namespace marble::client
