// Solves as fast as they come, for blocks of time: on a server, or in this process.
#pragma once

#include <atomic>

#include "base/bench.h"
#include "measure/machine.h"

namespace marble::bench {

/// What one block of time gave.
struct Block {
  double seconds = 0.0;
  int solves = 0;
  double server_cpu_s = 0.0, own_cpu_s = 0.0;  ///< of the processes, in the block

  [[nodiscard]] double solves_per_s() const { return solves / seconds; }
  [[nodiscard]] double server_cpu_per_solve_s() const { return server_cpu_s / solves; }
  [[nodiscard]] double own_cpu_per_solve_s() const { return own_cpu_s / solves; }
  /// With the part of the machine's cores that this process took given back: what the server would do if its
  /// clients had a machine of their own.
  [[nodiscard]] double accounted_solves_per_s(int cores) const {
    return solves_per_s() / (1.0 - own_cpu_s / (seconds * cores));
  }
};

/// Clients on one connection, each of which asks again as soon as it is answered.
class RemoteLoop {
 public:
  RemoteLoop(const std::string& address, const OwnedProblem& problem, int clients);
  [[nodiscard]] Block run(std::chrono::milliseconds time);

 private:
  void ask(Clock::time_point end, std::atomic<int>& solves);

  const OwnedProblem& problem_;
  const int clients_;
  v1::SolveRequest request_;
  const std::unique_ptr<v1::Solver::Stub> stub_;
  const std::unique_ptr<v1::Server::Stub> info_;
};

/// Threads that set the problem up and solve it again and again.
[[nodiscard]] Block run_in_process(const OwnedProblem& problem, int threads, std::chrono::milliseconds time);

using load::own_cpu_s;
/// And of a server, as it tells.
[[nodiscard]] double server_cpu_s(v1::Server::Stub& server);

/// Each value over that of the other list at the same place.
[[nodiscard]] std::vector<double> ratios(const std::vector<double>& values, const std::vector<double>& to);

}  // namespace marble::bench
