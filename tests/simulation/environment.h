// A server, its clients and what goes wrong, for some simulated hours; a model of what every client was
// promised judges what they see.
#pragma once

#include <cstdint>
#include <string>

namespace marble::simulation {

/// How the environment is; drawn from the seed, so that seeds differ in their weights (swarm testing).
struct Plan {
  std::uint64_t seed = 1;
  double hours = 1.0;
  int clients = 4;
  int workers = 2;
  int queue_jobs = 64;
  double think_s = 5.0;      ///< mean time between a client's calls
  double solve_s = 1.0;      ///< mean duration of a solve
  double crash_s = 600.0;    ///< mean time between crashes
  double stop_s = 1800.0;    ///< mean time between orderly restarts
  double full_s = 1e9;       ///< mean time until the disk is full, for some seconds
  double down_s = 5.0;       ///< mean time until a server is back
  double lost_reply = 0.02;  ///< probability that a reply does not reach its client
  double fatal_job = 0.002;  ///< probability that a submitted job kills the server that runs it
  double preemption = 0.02;
  [[nodiscard]] static Plan drawn(std::uint64_t seed, double hours);
};

struct Outcome {
  double hours = 0.0;
  std::int64_t calls = 0, jobs = 0, solves = 0, crashes = 0, stops = 0, hand_overs = 0;
  std::uint64_t digest = 0;
};

/// Once per process. `folder` is for the server's files.
void simulate(const Plan& plan, const std::string& folder, Outcome& outcome);

}  // namespace marble::simulation
