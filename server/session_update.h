// What an update of a session says, in the core's terms.
#pragma once

#include "marble/restart.h"
#include "marble/v1/session.pb.h"

namespace marble::server {

/// `newer` takes along what `older` would have changed and it does not change itself.
void take_along(v1::SessionUpdate older, v1::SessionUpdate& newer);

/// The initial point views the message, which must outlive it. Checks nothing.
[[nodiscard]] Restart restart_of(const v1::SessionUpdate& update);

/// Whether a session of these sizes can take it, but for its options. Error fields are paths from the
/// update's root.
[[nodiscard]] Expected<void> check_update(const v1::SessionUpdate& update, const PartSizes& sizes);

}  // namespace marble::server
