// Admission, queue and workers: takes jobs in, runs each on one of a fixed number of threads, answers every
// one.
#pragma once

#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "job.h"
#include "job_queue.h"
#include "log.h"
#include "mutex.h"

namespace marble::server {

struct SchedulerLimits {
  int workers = 1;
  int queue_jobs = 0;            ///< jobs that may wait for a worker
  std::int64_t queue_bytes = 0;  ///< request bytes that may wait or run
};

struct Counters {
  std::int64_t accepted = 0, answered = 0, solved = 0, refused = 0, cancelled = 0, failed = 0;
  int queued = 0, running = 0;
};

class Scheduler {
 public:
  Scheduler(const SchedulerLimits& limits, const Log& log);
  ~Scheduler();
  Scheduler(const Scheduler&) = delete;
  Scheduler& operator=(const Scheduler&) = delete;

  /// Takes the job in and returns its place in the queue; its observer will hear of it, exactly once to the
  /// end. Errors, after which the observer hears nothing: unavailable (draining), resource_exhausted (queue
  /// or bytes).
  [[nodiscard]] Expected<int> admit(std::shared_ptr<Job> job) ABSL_LOCKS_EXCLUDED(mutex_);

  /// The client gave up, or its deadline passed: a waiting job is answered at once, a running one stops
  /// within an iteration. Does nothing to a finished one.
  void cancel(const std::shared_ptr<Job>& job) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Counts a request that did not become a job, whoever refused it.
  void count_refused() ABSL_LOCKS_EXCLUDED(mutex_);

  /// Admits nothing more from now on.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Closes, then returns when every accepted job is answered. After `grace` running solves are stopped and
  /// give their best iterate, waiting ones are answered with unavailable.
  void drain(std::chrono::duration<double> grace) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Ends the grace of a drain that is under way now.
  void hurry() ABSL_LOCKS_EXCLUDED(mutex_);

  [[nodiscard]] Counters counters() const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] const SchedulerLimits& limits() const { return limits_; }
  /// When a refused request may be tried again: a queue's worth of the mean solve, within [10 ms, 10 s].
  [[nodiscard]] double retry_delay_s() const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void work() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::shared_ptr<Job> next() ABSL_LOCKS_EXCLUDED(mutex_);
  void run(Job& job) ABSL_LOCKS_EXCLUDED(mutex_);
  void finish(Job& job, Outcome outcome, bool ran) ABSL_LOCKS_EXCLUDED(mutex_);
  void count(const Job& job, const Outcome& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void log_end(const Job& job, const Outcome& outcome) const;
  [[nodiscard]] bool idle() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return counters_.queued == 0 && counters_.running == 0 && finishing_ == 0;
  }

  const SchedulerLimits limits_;
  const Log& log_;
  mutable Mutex mutex_;
  Condition work_;      // something was queued, or stopping_
  Condition progress_;  // something ended, or hurried_
  JobQueue<Job> queue_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::shared_ptr<Job>> running_ ABSL_GUARDED_BY(mutex_);
  std::int64_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  int finishing_ ABSL_GUARDED_BY(mutex_) = 0;  // left queue or worker, observer not yet told
  Counters counters_ ABSL_GUARDED_BY(mutex_);
  double mean_solve_s_ ABSL_GUARDED_BY(mutex_) = 0.0;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  bool hurried_ ABSL_GUARDED_BY(mutex_) = false;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> workers_;
};

}  // namespace marble::server
