// A connection to a Marble server, in the core's own terms: local and remote solves are one word apart.
//
//   auto answer = marble::solve(problem, options, controls);   // here
//   auto answer = client->solve(problem, options, controls);   // there
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

/// Where a client connects when nothing else is said: the environment's MARBLE_SERVER, else 127.0.0.1:50051.
[[nodiscard]] std::string default_server_address();

/// What a remote solve may have beyond SolveControls; all of it optional.
struct CallControls {
  /// Hard limit from now on: the server gives up what cannot meet it, and no answer comes back. (The option
  /// time_limit_s is the soft one: the best iterate comes back.) At most about 68 years count.
  std::optional<std::chrono::duration<double>> deadline = {};
  std::string request_id = {};       ///< for the server's log; at most 128 bytes of printable ASCII
  std::string problem_name = {};     ///< for logs and dashboards; shortened to 256 bytes
  double progress_interval_s = 0.0;  ///< least time between two reports, seconds, >= 0; 0 is every iteration
  std::int32_t iterate_every = 0;    ///< Progress.z is there in every k-th report; 0: never (z is empty)
  /// The job has an id and waits behind `queue_position` others. Called on the thread that called solve.
  std::function<void(const std::string& job_id, int queue_position)> accepted = {};
  /// A worker took the job. Called on the thread that called solve.
  std::function<void(double queue_s)> started = {};
};

/// A solution with what the server adds to it.
struct RemoteSolution : Solution {
  std::string job_id;                 ///< as in the server's log
  double queue_s = 0.0;               ///< waiting for a worker
  double total_s = 0.0;               ///< from acceptance to the answer, on the server
  std::int64_t progress_skipped = 0;  ///< reports that were dropped, because the network was slower
};

/// What Server.GetInfo tells. See service.proto for the meaning of each.
struct ServerInfo {
  std::string version;
  int workers = 0;
  std::int64_t message_bytes = 0, queue_bytes = 0;
  int queue_jobs = 0;
  std::int64_t accepted = 0, answered = 0, solved = 0, refused = 0, cancelled = 0, failed = 0;
  int queued = 0, running = 0;
  double uptime_s = 0.0;
};

/// Thread-safe; one connection serves any number of calls at once. No call throws.
/// Errors: unavailable (not reachable, draining, not a Marble server), invalid_argument (field, index and
/// bound as Problem::create says them), resource_exhausted, deadline_exceeded, cancelled, permission_denied,
/// internal.
class Client {
 public:
  /// `address` is host:port or unix:PATH. Only checks the address: the connection is made by the first call,
  /// and made again by a later one if it broke. The error's field is "address".
  [[nodiscard]] static Expected<Client> connect(const std::string& address = default_server_address());

  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;
  ~Client();

  /// Solves on the server. `controls` mean what they mean to marble::solve: progress is reported on the
  /// calling thread, the stop token gives the call up (error cancelled; the server stops within one
  /// iteration). Streams if anything wants to be told, else makes one unary call.
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options = {},
                                               const SolveControls& controls = {},
                                               const CallControls& call = {}) const;

  /// True if the server takes jobs, false if it drains.
  [[nodiscard]] Expected<bool> healthy() const;

  [[nodiscard]] Expected<ServerInfo> info() const;

  [[nodiscard]] const std::string& address() const;

 private:
  struct Connection;
  explicit Client(std::unique_ptr<Connection> connection);
  std::unique_ptr<Connection> connection_;
};

}  // namespace marble
