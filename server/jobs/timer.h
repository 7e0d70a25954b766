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
class TimerListener {
 public:
  virtual ~TimerListener() = default;
  virtual void on_timer(Clock::time_point now) = 0;
};

class Timer {
 public:
  static constexpr std::chrono::milliseconds kPeriod{25};

  Timer();
  ~Timer();
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

  void add(const std::weak_ptr<TimerListener>& listener) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void run() ABSL_LOCKS_EXCLUDED(mutex_);

  Mutex mutex_;
  Condition wake_;
  std::vector<std::weak_ptr<TimerListener>> listeners_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace marble::server
