// Provides a discrete-event simulation of planners, a balancer and servers. Each server's queue is the
// server's own code, server/jobs/job_queue.h; time, the solves and the network are simulated.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace marble::fleet_sim {

enum class Balance { least, two, round_robin, random };

/// Returns the names used on the command line, in the enum's order.
[[nodiscard]] const std::vector<std::string>& balance_names();

/// How the number of servers follows the load, as in Kubernetes: every `poll_s` it becomes the number of busy
/// workers, averaged over `window_s`, divided by `target` busy workers per server; it at most doubles; a new
/// server accepts work `start_s` later. It never shrinks here: the simulation measures how fast it must grow.
struct Autoscaler {
  double poll_s = 0.0;  ///< 0: no autoscaler
  double window_s = 30.0;
  double start_s = 10.0;
  double target = 2.4;
};

/// A job of a real server, from its log.
struct Recorded {
  double arrival_s = 0.0;
  double service_s = 0.0;
};

struct Plan {
  int planners = 100;
  double rate_hz = 20.0;  ///< of each planner's control steps; 0: sends the next one at once after a result
  bool sessions =
      false;  ///< a planner stays with a server, and its newer control step replaces a waiting one
  int servers = 1;
  int workers = 4;           ///< per server
  double slow_factor = 1.0;  ///< factor on the duration of the first server's solves
  Balance balance = Balance::least;
  double deadline_s = 0.05;       ///< from control step to result; what waits longer is not run. 0: none
  double network_s = 0.0002;      ///< one way
  double overhead_s = 0.0;        ///< of a solve on its worker, in addition to the solve
  std::vector<double> service_s;  ///< durations of solves, each equally likely
  double warm_s = 1.0;            ///< excluded from the results
  double run_s = 10.0;
  double ramp_from =
      0.0;  ///< share of the planners that exist from the start; the others arrive evenly in ramp_s
  double ramp_s = 0.0;  ///< 0: all exist from the start
  Autoscaler autoscaler;
  std::vector<Recorded> recorded;  ///< if any: replays these jobs instead of planners
  std::uint64_t seed = 1;
};

struct Outcome {
  std::int64_t ticks = 0;       ///< in the measured time
  std::int64_t answered = 0;    ///< in time
  std::int64_t late = 0;        ///< completed late, or cancelled
  std::int64_t superseded = 0;  ///< by the planner's own next control step
  std::vector<double> wait_s;   ///< in a queue, sorted
  std::vector<double> total_s;  ///< control step to result, sorted
  double busy = 0.0;            ///< share of the workers' time
  int servers_at_end = 0;
  std::vector<std::int64_t> served;  ///< by each server

  [[nodiscard]] double missed() const {
    return ticks == 0 ? 0.0 : static_cast<double>(late + superseded) / static_cast<double>(ticks);
  }
};

/// Returns a quantile of sorted values; share in [0, 1].
[[nodiscard]] double quantile(const std::vector<double>& sorted, double share);

[[nodiscard]] Outcome simulate(const Plan& plan);

}  // namespace marble::fleet_sim
