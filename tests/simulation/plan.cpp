#include <cmath>

#include "environment.h"
#include "random.h"

namespace marble::simulation {

Plan Plan::drawn(std::uint64_t seed, double hours) {
  Random random(seed);
  Plan plan{.seed = seed, .hours = hours};
  plan.clients = 1 + static_cast<int>(random.below(8));
  plan.workers = 1 + static_cast<int>(random.below(3));
  plan.queue_jobs = random.chance(0.3) ? 4 + static_cast<int>(random.below(8)) : 64;
  plan.think_s = std::exp(random.between(std::log(0.3), std::log(20.0)));
  plan.solve_s = std::exp(random.between(std::log(0.02), std::log(5.0)));
  plan.crash_s = std::exp(random.between(std::log(20.0), std::log(2000.0)));
  plan.stop_s = std::exp(random.between(std::log(100.0), std::log(5000.0)));
  if (random.chance(0.3)) plan.full_s = std::exp(random.between(std::log(50.0), std::log(1000.0)));
  plan.down_s = std::exp(random.between(std::log(0.1), std::log(30.0)));
  plan.lost_reply = random.chance(0.5) ? 0.0 : random.between(0.0, 0.1);
  plan.fatal_job = random.chance(0.6) ? 0.0 : random.between(0.0, 0.02);
  plan.preemption = random.chance(0.5) ? 0.02 : random.between(0.0, 0.2);
  return plan;
}

}  // namespace marble::simulation
