// A connection to a Marble server, in the core's own terms: local and remote solves are one line apart.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/solution.h"

namespace marble {

/// Where a client connects when nothing else is said: the environment's MARBLE_SERVER, else 127.0.0.1:50051.
[[nodiscard]] std::string default_server_address();

/// What a streamed solve tells beside its progress. Called on a thread of the client.
struct JobEvents {
  std::function<void(const std::string& job_id, int queue_position)> accepted;
  std::function<void(double queue_s)> started;
};

/// What may accompany one remote solve; all of it optional.
struct RemoteControls {
  ProgressSink* progress =
      nullptr;  ///< told of progress; rows may be skipped where the network is slower than the solver
  double progress_interval_s = 0.0;        ///< least time between two rows, seconds, >= 0
  std::stop_token stop = {};               ///< gives the call up; the server stops within one iteration
  std::span<const double> initial_z = {};  ///< n or empty: where to start
  std::optional<std::chrono::duration<double>>
      deadline;              ///< from now; the server gives up what cannot meet it
  std::string request_id;    ///< for the server's log; at most 128 bytes of printable ASCII
  std::string problem_name;  ///< for logs and dashboards; at most 256 bytes
  JobEvents events = {};
};

/// A solution with what the server adds to it.
struct RemoteSolution {
  Solution solution;
  std::string job_id;
  double queue_s = 0.0;  ///< waiting for a worker
  double total_s = 0.0;  ///< from acceptance to the answer, on the server
};

/// What Server.GetInfo tells. See service.proto for the meaning of each.
struct ServerInfo {
  std::string version;
  int workers = 0;
  std::int64_t message_bytes = 0, queue_bytes = 0;
  int queue_jobs = 0;
  std::int64_t accepted = 0, answered = 0, solved = 0, refused = 0, cancelled = 0;
  int queued = 0, running = 0;
  double uptime_s = 0.0;
};

/// Thread-safe; one connection serves any number of calls at once. No call throws.
/// Errors: unavailable (not reachable, draining), invalid_argument (field, index and bound as Problem::create
/// says them), resource_exhausted, deadline_exceeded, cancelled, permission_denied, internal.
class Client {
 public:
  /// `address` is host:port or unix:PATH. Connects on the first call.
  explicit Client(const std::string& address = default_server_address());
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;
  ~Client();

  /// Solves on the server. Streams if progress or an event is wanted, else makes one unary call.
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemView& problem, const Options& options = {},
                                               const RemoteControls& controls = {});

  /// True if the server takes jobs, false if it drains.
  [[nodiscard]] Expected<bool> healthy();

  [[nodiscard]] Expected<ServerInfo> info();

  [[nodiscard]] const std::string& address() const;

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

}  // namespace marble
