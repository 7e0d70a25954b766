// Limits on one client's use of the server.
#pragma once

#include <cstdint>
#include <limits>

#include "base/priority.h"

namespace marble::server {

struct Quota {
  int running = std::numeric_limits<int>::max();                  ///< concurrent solves
  int queued = std::numeric_limits<int>::max();                   ///< jobs that wait
  int sessions = std::numeric_limits<int>::max();                 ///< open sessions
  int watchers = std::numeric_limits<int>::max();                 ///< feeds of job events
  int bundles = std::numeric_limits<int>::max();                  ///< concurrent replay bundles
  std::int64_t bytes = std::numeric_limits<std::int64_t>::max();  ///< size of requests that wait or run
  Priority priority = Priority::realtime;                         ///< the highest it may request
};

}  // namespace marble::server
