// What the parts of the service benchmark share: a server of their own, and statistics.
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "marble/problem.h"
#include "marble/v1/service.grpc.pb.h"
#include "support/processes/server_process.h"

namespace marble::bench {

using Clock = std::chrono::steady_clock;

/// A server on a free port, from the marble-server beside this program.
[[nodiscard]] testing::ServerProcess start_server(const std::vector<std::string>& flags);

/// A connection of its own, with messages of any size.
[[nodiscard]] std::shared_ptr<grpc::Channel> connect(const std::string& address);

[[nodiscard]] double ms_since(Clock::time_point begin);

/// The value below which this part of the values is; of no values, NaN.
[[nodiscard]] double quantile(std::vector<double> values, double part);
[[nodiscard]] inline double median(const std::vector<double>& values) { return quantile(values, 0.5); }
[[nodiscard]] inline double worst(const std::vector<double>& values) { return quantile(values, 1.0); }

/// Whether a solution is solved, and feasible by plain loops over the problem.
[[nodiscard]] bool is_right(const OwnedProblem& problem, const v1::Solution& solution);

/// Ends the program with what went wrong: a benchmark of what does not work tells nothing.
void must(bool holds, const std::string& what);
void must(const grpc::Status& status, const std::string& what);

/// A session as a control loop uses it: an update, its answer.
class Session {
 public:
  /// `client` is the name it goes by; empty for none.
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

/// Sets up the problem in a session of this priority.
[[nodiscard]] v1::SessionSetup setup_of(const OwnedProblem& problem,
                                        v1::Priority priority = v1::PRIORITY_UNSPECIFIED);
/// Every vector of the problem, and a plan that moves on by one of `steps` stages.
[[nodiscard]] v1::SessionUpdate next_tick(const OwnedProblem& problem, int steps);

}  // namespace marble::bench
