// What a solve sends.
#pragma once

#include "marble/client.h"
#include "marble/v1/service.pb.h"

namespace marble::client {

/// Copies everything into the request. Errors: request_id is not printable ASCII of at most 128 bytes, the
/// whole is more than protobuf's 2 GiB.
[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const ProblemView& problem,
                                                            const Options& options,
                                                            const SolveControls& controls,
                                                            const CallControls& call);

}  // namespace marble::client
