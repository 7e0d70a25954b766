// Provides the common parts of the service benchmark: a server process, and statistics.
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "marble/problem.h"
#include "marble/v1/service.grpc.pb.h"
#include "support/server_process.h"

namespace marble::bench {

using Clock = std::chrono::steady_clock;

/// Starts a server on a free port, from the marble-server beside this program.
[[nodiscard]] testing::ServerProcess start_server(const std::vector<std::string>& flags);

/// Opens a separate connection, with messages of any size.
[[nodiscard]] std::shared_ptr<grpc::Channel> connect(const std::string& address);

[[nodiscard]] double ms_since(Clock::time_point begin);

/// Returns the value below which this part of the values lies; NaN without values.
[[nodiscard]] double quantile(std::vector<double> values, double part);
[[nodiscard]] inline double median(const std::vector<double>& values) { return quantile(values, 0.5); }
[[nodiscard]] inline double worst(const std::vector<double>& values) { return quantile(values, 1.0); }

/// Returns whether a solution is solved, and feasible by plain loops over the problem.
[[nodiscard]] bool is_right(const OwnedProblem& problem, const v1::Solution& solution);

/// Ends the program with the failure: a benchmark of a broken system is meaningless.
void must(bool holds, const std::string& what);
void must(const grpc::Status& status, const std::string& what);

/// A session as a control loop uses it: sends an update, returns its solution.
class Session {
 public:
  /// `client` is its name; empty for none.
  Session(const std::shared_ptr<grpc::Channel>& channel, const v1::SessionSetup& setup,
          const std::string& client = "");
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  [[nodiscard]] const v1::SessionReady& ready() const { return ready_; }
  [[nodiscard]] v1::Solution solve(v1::SessionUpdate update);

 private:
  std::unique_ptr<v1::Solver::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::SessionRequest, v1::SessionResponse>> stream_;
  v1::SessionReady ready_;
  std::int64_t sequence_ = 0;
};

/// Returns the set-up of a session with this problem and priority.
[[nodiscard]] v1::SessionSetup setup_of(const OwnedProblem& problem,
                                        v1::Priority priority = v1::PRIORITY_UNSPECIFIED);
/// Returns every vector of the problem, and a shift of the plan by one of `steps` stages.
[[nodiscard]] v1::SessionUpdate next_tick(const OwnedProblem& problem, int steps);

// Compares a measurement with a promise: a ratio, and its limit.
struct Finding {
  std::string name;    ///< "hopper, session: latency over local solve"
  double value = 0.0;  ///< usually a ratio
  double limit = 0.0;
  bool at_most = true;  ///< else the value should be at least the limit
  std::string detail;   ///< the underlying figures

  [[nodiscard]] bool holds() const { return at_most ? value <= limit : value >= limit; }
};

/// Prints the finding, and keeps it for write_findings().
void report(Finding finding);

/// Writes all findings so far as a JSON array, {name, value, limit, at_most, holds, detail} each. Returns
/// false if the file cannot be written.
[[nodiscard]] bool write_findings(const std::string& path);

// Declares the parts of the service benchmark: each starts its own server and prints its measurements.

/// The hopper's receding horizon, warm in a session against cold unary solves.
void mpc();
/// A control loop's steps while other clients flood the server.
void flood();
/// A control loop's steps beside long batch work of every kind, and the throughput of batch work beside
/// steps.
void beside();
/// Idle sessions.
void idle();
/// The cost of metrics, logs, traces and watchers.
void cost();
/// The same solves remote and in process; tiny ones beside a bare echo.
void remote();
/// Two workers against two threads in process.
void throughput();
/// Full load beside idle sessions and dashboards.
void crowd();
/// Submitted jobs kept in memory, by SQLite, by PostgreSQL.
void durable();
/// The cost of reporting every iteration.
void streaming();

}  // namespace marble::bench
