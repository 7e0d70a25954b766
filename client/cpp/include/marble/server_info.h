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
  int running = 0, queued = 0, sessions = 0;
  std::int64_t bytes = 0;
  Priority priority = Priority::realtime;  ///< the highest
};

/// What Server.GetInfo tells. See service.proto for the meaning of each.
struct ServerInfo {
  std::string version;
  int workers = 0;
  double uptime_s = 0.0;
  std::string client;              ///< the caller's name there; empty if the server does not say
  std::vector<std::string> roles;  ///< what the caller may do: "solve", "observe", "admin"
  std::optional<ClientQuota> quota;

  /// Limits.
  std::int64_t message_bytes = 0, queue_bytes = 0, solve_bytes = 0, session_bytes_limit = 0,
               result_bytes_limit = 0;
  int queue_jobs = 0, sessions_limit = 0, session_updates = 0, batch_window = 0, history_jobs = 0,
      trace_rows = 0, trace_pairs = 0;
  double session_idle_s = 0.0, result_keep_s = 0.0;

  /// Counters since the server's start.
  std::int64_t accepted = 0, answered = 0, solved = 0, refused = 0, cancelled = 0, failed = 0;
  std::int64_t sessions_opened = 0, updates = 0, updates_solved = 0;
  double busy_s = 0.0;  ///< that workers have spent on jobs, all together
  double cpu_s = 0.0;   ///< of the server's process
  /// Now.
  int queued = 0, running = 0, sessions = 0;
  std::int64_t session_bytes = 0, result_bytes = 0, resident_bytes = 0;
  std::array<int, 3> queued_by_priority = {};   ///< realtime, interactive, batch
  std::array<double, 3> estimated_wait_s = {};  ///< of a job of each that came now
};

}  // namespace marble
