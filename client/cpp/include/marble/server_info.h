// What a server tells about itself.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "marble/call_controls.h"

namespace marble {

/// What one client may use.
struct ClientQuota {
  int running = 0;                         ///< solves at once
  int queued = 0;                          ///< jobs that wait
  int sessions = 0;                        ///< open ones
  std::int64_t bytes = 0;                  ///< of requests that wait or run
  Priority priority = Priority::realtime;  ///< the highest
  int watchers = 0;                        ///< streams of job events; 0 if the server does not say
};

/// What a server tells about itself, its limits and its counters.
struct ServerInfo {
  std::string version;               ///< "0.1.0"
  int workers = 0;                   ///< solves that can run at once
  double uptime_s = 0.0;             ///< seconds since its start
  std::string client;                ///< the caller's name there; empty if the server does not say
  std::vector<std::string> roles;    ///< what the caller may do: "solve", "observe", "admin"
  std::optional<ClientQuota> quota;  ///< what the caller may use; absent where nothing says so

  // Limits in force.
#define MARBLE_LIMIT(type, name, field, doc) type name = 0;
#include "marble/server_info.def"

  // Counters: since the server's start, or of now.
#define MARBLE_COUNTER(type, name, field, doc) type name = 0;
#include "marble/server_info.def"

  std::array<int, 3> queued_by_priority = {};   ///< jobs and updates now: realtime, interactive, batch
  std::array<double, 3> estimated_wait_s = {};  ///< seconds, of a job of each that came now
};

}  // namespace marble
