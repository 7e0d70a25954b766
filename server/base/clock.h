// The clock of every duration and deadline inside the server.
#pragma once

#include <chrono>

namespace marble::server {

using Clock = std::chrono::steady_clock;

}  // namespace marble::server
