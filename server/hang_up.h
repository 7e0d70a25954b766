// The end of a server as its clients see it.
#pragma once

#include <string>
#include <vector>

namespace marble::server {

/// Listens on none of the addresses any more and ends this process's connections to them. What was written to
/// them still arrives; a call that comes too late finds its connection closed, which is UNAVAILABLE to every
/// client, and is sent elsewhere. gRPC's own shutdown would answer it with CANCELLED, which nobody retries.
void hang_up(const std::vector<std::string>& addresses);

}  // namespace marble::server
