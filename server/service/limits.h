// Limits of the queue and of kept results, from the configuration.
#pragma once

#include "base/process.h"
#include "config/config.h"
#include "jobs/result_store.h"
#include "jobs/scheduler.h"

namespace marble::server {

[[nodiscard]] inline Clock::duration duration_of(double seconds) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

[[nodiscard]] inline QueueLimits queue_limits(const Config& config) {
  return {.workers = config.workers > 0 ? config.workers : usable_cores(),
          .jobs = config.queue_jobs,
          .bytes = config.queue_bytes,
          .starvation_limit = config.starvation_limit,
          .starvation_time = duration_of(config.starvation_limit_s)};
}

[[nodiscard]] inline ResultLimits result_limits(const Config& config) {
  return {duration_of(config.result_keep_s), config.result_bytes};
}

/// Deletes results whose retention time is over.
class ResultExpiry final : public TimerListener {
 public:
  explicit ResultExpiry(ResultStore& results) : results_(results) {}
  void on_timer(Clock::time_point now) override { results_.expire(now); }

 private:
  ResultStore& results_;
};

}  // namespace marble::server
