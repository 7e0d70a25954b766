// Builds the requests of a session.
#pragma once

#include "marble/session.h"
#include "marble/v1/session.pb.h"

namespace marble::client {

[[nodiscard]] Expected<v1::SessionRequest> make_setup(const ProblemView& problem, const Options& options,
                                                      const SessionOptions& session);
/// `epoch` is the epoch of the set-up.
[[nodiscard]] Expected<v1::SessionRequest> make_update(std::int64_t epoch, std::int64_t sequence,
                                                       const ProblemUpdate& update,
                                                       const UpdateControls& controls, bool first_part);

}  // namespace marble::client
