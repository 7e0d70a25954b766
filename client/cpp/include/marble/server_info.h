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

  std::int64_t message_bytes = 0;        ///< limit: largest message, in and out
  std::int64_t queue_bytes = 0;          ///< limit: requests that wait or run, together
  std::int64_t solve_bytes = 0;          ///< limit: memory of one solver
  std::int64_t session_bytes_limit = 0;  ///< limit: memory of all sessions together
  std::int64_t result_bytes_limit = 0;   ///< limit: answers kept, together
  int queue_jobs = 0;                    ///< limit: jobs that wait
  int sessions_limit = 0;                ///< limit: open sessions
  int session_updates = 0;               ///< limit: updates of a session that wait
  int batch_window = 0;         ///< limit: problems of a batch that wait, run or are answered at a time
  int history_jobs = 0;         ///< limit: finished jobs that are remembered
  int trace_rows = 0;           ///< limit: rows of progress kept of a job
  int trace_pairs = 0;          ///< limit: pairs of a problem whose sides are kept for those who watch
  double solve_seconds = 0.0;   ///< limit: predicted time of one factorization
  double session_idle_s = 0.0;  ///< limit: seconds without an update until a session is ended
  double result_keep_s = 0.0;   ///< limit: seconds for which a submitted job's answer is kept

  std::int64_t accepted = 0;         ///< jobs, since the start
  std::int64_t answered = 0;         ///< jobs with a solution, whatever its status, since the start
  std::int64_t solved = 0;           ///< of these, since the start
  std::int64_t refused = 0;          ///< requests: invalid, queue full or draining, since the start
  std::int64_t cancelled = 0;        ///< jobs given up by their client, deadline or a drain, since the start
  std::int64_t failed = 0;           ///< jobs that ended in an error, since the start
  std::int64_t sessions_opened = 0;  ///< since the start
  std::int64_t updates = 0;          ///< of sessions, answered, since the start; not among the jobs
  std::int64_t updates_solved = 0;   ///< of these, since the start
  double busy_s = 0.0;               ///< that workers have spent on jobs, all together
  double cpu_s = 0.0;                ///< of the server's process

  int queued = 0;                               ///< jobs now
  int running = 0;                              ///< jobs now
  int sessions = 0;                             ///< open now
  std::int64_t session_bytes = 0;               ///< memory of these
  std::int64_t result_bytes = 0;                ///< answers kept now
  std::int64_t request_bytes = 0;               ///< of requests that wait or run now
  std::int64_t resident_bytes = 0;              ///< memory of the server's process now
  std::array<int, 3> queued_by_priority = {};   ///< realtime, interactive, batch
  std::array<double, 3> estimated_wait_s = {};  ///< of a job of each that came now
};

}  // namespace marble
