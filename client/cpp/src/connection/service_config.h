// Provides gRPC's own retries and load balancing: it retries idempotent calls and rotates over healthy
// servers.
#pragma once

#include <string>

namespace marble::client {

/// Returns gRPC's service config as JSON. Calls that get UNAVAILABLE before any response are retried at most
/// three times if a repetition has the same effect: solves are pure, reads change nothing, a submission is
/// one job by its request id. Not retried: Delete, Cancel, sessions and batches, whose first message may have
/// been processed. With `several` servers, calls rotate over those that report to be healthy.
[[nodiscard]] std::string service_config(bool several);

}  // namespace marble::client
