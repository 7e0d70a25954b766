// Solves as fast as possible for blocks of time: on a server, or in this process.
#pragma once

#include <atomic>

#include "bench.h"
#include "machine.h"

namespace marble::bench {

/// The result of one block of time.
struct Block {
  double seconds = 0.0;
  int solves = 0;
  double server_cpu_s = 0.0, own_cpu_s = 0.0;  ///< of the processes, in the block

  [[nodiscard]] double solves_per_s() const { return solves / seconds; }
  [[nodiscard]] double server_cpu_per_solve_s() const { return server_cpu_s / solves; }
  [[nodiscard]] double own_cpu_per_solve_s() const { return own_cpu_s / solves; }
  /// Returns the rate with this process's share of the machine's cores given back: the server's rate if its
  /// clients had a separate machine.
  [[nodiscard]] double accounted_solves_per_s(int cores) const {
    return solves_per_s() / (1.0 - own_cpu_s / (seconds * cores));
  }
};

/// Clients on one connection, each of which sends the next request as soon as it has its result.
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

/// Runs threads that set the problem up and solve it repeatedly.
[[nodiscard]] Block run_in_process(const OwnedProblem& problem, int threads, std::chrono::milliseconds time);

using load::own_cpu_s;
/// The same for a server, as it reports.
[[nodiscard]] double server_cpu_s(v1::Server::Stub& server);

/// Returns each value divided by that of the other list at the same position.
[[nodiscard]] std::vector<double> ratios(const std::vector<double>& values, const std::vector<double>& to);

}  // namespace marble::bench
