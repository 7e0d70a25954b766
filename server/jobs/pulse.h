// One timer thread for everything that depends on time: idle sessions, old results, late jobs, slow
// watchers.
#pragma once

#include <memory>
#include <thread>
#include <vector>

#include "jobs/job_record.h"
#include "mutex.h"

namespace marble::server {

/// Called by the timer while it lives.
class Pulsed {
 public:
  virtual ~Pulsed() = default;
  virtual void pulse(Clock::time_point now) = 0;
};

class Pulse {
 public:
  static constexpr std::chrono::milliseconds kPeriod{25};

  Pulse();
  ~Pulse();
  Pulse(const Pulse&) = delete;
  Pulse& operator=(const Pulse&) = delete;

  void add(const std::weak_ptr<Pulsed>& pulsed) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void run() ABSL_LOCKS_EXCLUDED(mutex_);

  Mutex mutex_;
  Condition wake_;
  std::vector<std::weak_ptr<Pulsed>> pulsed_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace marble::server
