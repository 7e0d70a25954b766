// Provides the options of a remote solve, and what a server adds to its solution.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "marble/error.h"
#include "marble/solution.h"

namespace marble {

/// Which job runs first when the server's workers are busy.
enum class Priority {
  by_method,    ///< realtime for sessions, batch for batches, else interactive
  realtime,     ///< control loops
  interactive,  ///< a user waits
  batch,        ///< no one waits
};

/// "by_method", "realtime", "interactive", "batch".
[[nodiscard]] const char* to_string(Priority priority);

/// Options of a remote solve beyond SolveControls; all of them optional.
struct CallControls {
  /// Hard limit from now on: the server drops a job that cannot meet it, and no solution is returned. (The
  /// option time_limit_s is the soft limit: it returns the best iterate.) Capped at about 68 years.
  std::optional<std::chrono::duration<double>> deadline = {};
  std::string request_id = {};       ///< for the server's log; at most 128 bytes of printable ASCII
  std::string problem_name = {};     ///< for logs and dashboards; shortened to 256 bytes
  double progress_interval_s = 0.0;  ///< least time between two reports, seconds, >= 0; 0 is every iteration
  std::int32_t iterate_every = 0;    ///< Progress.z is set in every k-th report; 0: never (z is empty)
  Priority priority = Priority::by_method;  ///< which jobs run first when workers are busy
  std::string traceparent = {};  ///< the caller's span, as ConnectOptions::traceparent; empty: uses that one
  /// Called when the job has an id and waits behind `queue_position` others, for about `estimated_wait_s`
  /// seconds. Runs on the thread that called solve, as do the others.
  std::function<void(const std::string& job_id, int queue_position, double estimated_wait_s)> accepted = {};
  /// Called when the position of the waiting job has changed.
  std::function<void(int queue_position, double estimated_wait_s)> moved = {};
  /// Called when a worker took the job.
  std::function<void(double queue_s)> started = {};
  /// For submissions: how long to wait while the server's queue, or the client's share of it, is full,
  /// seconds
  /// >= 0 from the first refusal on. Then the result is the refusal, resource_exhausted. Default: until the
  /// deadline, or 10 s if there is none.
  std::optional<std::chrono::duration<double>> queue_wait = {};
  /// Called once when a submission begins to wait for that, with the server's reason.
  std::function<void(const Error& reason)> waiting = {};
};

/// A solution with what the server adds to it.
struct RemoteSolution : Solution {
  std::string job_id;                 ///< as in the server's log; empty if it was solved in process
  double queue_s = 0.0;               ///< waiting for a worker
  double total_s = 0.0;               ///< from acceptance to the solution, on the server
  std::int64_t progress_skipped = 0;  ///< reports that were dropped because the network was slower
  std::string traceparent = {};       ///< the server's span in the caller's trace; empty if none was sent
  /// True if the session's server was lost and the session was opened again for this solution
  /// (SessionOptions::reopen).
  bool reopened = false;
};

}  // namespace marble
