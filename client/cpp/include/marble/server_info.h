// Provides a server's information about itself.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "marble/call_controls.h"

namespace marble {

/// The quota of one client.
struct ClientQuota {
  int running = 0;                         ///< concurrent solves
  int queued = 0;                          ///< waiting jobs
  int sessions = 0;                        ///< open sessions
  std::int64_t bytes = 0;                  ///< of waiting or running requests
  Priority priority = Priority::realtime;  ///< the highest
  int watchers = 0;                        ///< streams of job events; 0 if the server does not report it
};

/// A server's information about itself, its limits and its counters.
struct ServerInfo {
  std::string version;    ///< "0.1.0"
  int workers = 0;        ///< solves that can run at once
  double uptime_s = 0.0;  ///< seconds since its start
  std::string client;     ///< the caller's name on the server; empty if the server does not report it
  std::vector<std::string> roles;    ///< the caller's rights: "solve", "observe", "admin"
  std::optional<ClientQuota> quota;  ///< the caller's quota; absent if there is none

  // Limits in force.
#define MARBLE_LIMIT(type, name, field, doc) type name = 0;
#include "marble/server_info.def"

  // Counters: since the server's start, or current values.
#define MARBLE_COUNTER(type, name, field, doc) type name = 0;
#include "marble/server_info.def"

  std::array<int, 3> queued_by_priority = {};   ///< current jobs and updates: realtime, interactive, batch
  std::array<double, 3> estimated_wait_s = {};  ///< seconds, for a new job of each priority
};

}  // namespace marble
