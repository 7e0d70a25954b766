// A discrete-event simulation of planners, a balancer and servers. Each server's queue is the server's own
// code, server/queue/job_queue.h; time, the solves and the network are made up.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace marble::fleet_sim {

enum class Balance { least, two, round_robin, random };

/// Names as on the command line, in the enum's order.
[[nodiscard]] const std::vector<std::string>& balance_names();

/// How the number of servers follows the load, as Kubernetes' does: every `poll_s` it becomes the busy
/// workers, averaged over `window_s`, divided by `target` busy ones a server; at most doubled; a new server
/// takes work `start_s` later. It never shrinks here: what is asked is how fast it must grow.
struct Autoscaler {
  double poll_s = 0.0;  ///< 0: there is none
  double window_s = 30.0;
  double start_s = 10.0;
  double target = 2.4;
};

/// A job of a real server, as its log has it.
struct Recorded {
  double arrival_s = 0.0;
  double service_s = 0.0;
};

struct Plan {
  int planners = 100;
  double rate_hz = 20.0;  ///< of each planner's ticks; 0: it asks again as soon as it has its answer
  bool sessions =
      false;  ///< a planner stays with a server, and its newer tick takes the place of one that waits
  int servers = 1;
  int workers = 4;           ///< of a server
  double slow_factor = 1.0;  ///< solves of the first server take this many times longer
  Balance balance = Balance::least;
  double deadline_s = 0.05;       ///< from tick to answer; what waits longer is not run. 0: none
  double network_s = 0.0002;      ///< one way
  double overhead_s = 0.0;        ///< of a solve on its worker, beside the solve itself
  std::vector<double> service_s;  ///< solves take one of these, each as likely
  double warm_s = 1.0;            ///< not counted
  double run_s = 10.0;
  double ramp_from =
      0.0;  ///< share of the planners that is there from the start; the others come evenly in ramp_s
  double ramp_s = 0.0;  ///< 0: all are there from the start
  Autoscaler autoscaler;
  std::vector<Recorded> recorded;  ///< if any: these jobs instead of planners
  std::uint64_t seed = 1;
};

struct Outcome {
  std::int64_t ticks = 0;       ///< in the counted time
  std::int64_t answered = 0;    ///< in time
  std::int64_t late = 0;        ///< answered late, or given up
  std::int64_t superseded = 0;  ///< by the planner's own next tick
  std::vector<double> wait_s;   ///< in a queue, sorted
  std::vector<double> total_s;  ///< tick to answer, sorted
  double busy = 0.0;            ///< share of the workers' time
  int servers_at_end = 0;
  std::vector<std::int64_t> served;  ///< by each server

  [[nodiscard]] double missed() const {
    return ticks == 0 ? 0.0 : static_cast<double>(late + superseded) / static_cast<double>(ticks);
  }
};

/// Of sorted values; share in [0, 1].
[[nodiscard]] double quantile(const std::vector<double>& sorted, double share);

[[nodiscard]] Outcome simulate(const Plan& plan);

}  // namespace marble::fleet_sim
