// Admission, queue and workers: accepts jobs, runs each on one of a fixed number of threads, and gives every
// job a result.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "base/last_minute.h"
#include "base/refusal.h"
#include "jobs/client_use.h"
#include "jobs/job.h"
#include "jobs/job_board.h"
#include "jobs/latencies.h"
#include "jobs/run_estimates.h"
#include "jobs/timer.h"
#include "log/log.h"
#include "metrics/metrics.h"
#include "mutex.h"

namespace marble::server {

struct Counters {
  std::int64_t accepted = 0, answered = 0, solved = 0, refused = 0, cancelled = 0, failed = 0;
  std::int64_t updates = 0, updates_solved = 0;  ///< updates of sessions with a result
  std::array<std::int64_t, kRefusalReasons> refused_by_reason = {};
  double busy_s = 0.0;  ///< time that workers have spent on jobs
  int queued = 0, running = 0;
  std::int64_t request_bytes = 0;  ///< waiting or running
  std::array<int, kPriorities> queued_by_priority = {};
  std::array<double, kPriorities> estimated_wait_s = {};  ///< wait of a job that would arrive now
};

/// An object that waits for capacity in a full queue.
class RoomWaiter {
 public:
  virtual ~RoomWaiter() = default;
  /// There may be capacity now.
  virtual void room() = 0;
};

/// Returns the error for a queue's refusal. `none` is no error.
[[nodiscard]] Error refusal_of(QueueRefusal why, const QueueLimits& limits, const Ticket& ticket,
                               const Quota& quota);

/// Returns the error of a job that was not begun because of its deadline.
[[nodiscard]] Error too_late(const Job& job, Clock::time_point now);

/// Returns what is counted of a job that has ended; views both arguments. A session's set-up solves nothing,
/// and its updates set up nothing.
[[nodiscard]] EndedJob counted_of(const Job& job, const Outcome& outcome);

class Scheduler final : public TimerListener, public TaskRunner {
 public:
  Scheduler(const QueueLimits& limits, JobBoard& board, const Log& log, Metrics& metrics);
  ~Scheduler() override;
  Scheduler(const Scheduler&) = delete;
  Scheduler& operator=(const Scheduler&) = delete;

  /// Accepts the job and returns its place in the queue; its observer is notified until the end, which is
  /// reported exactly once. Errors, after which the observer is not called: unavailable (draining),
  /// resource_exhausted (queue, bytes, or the client's quota of them; the waiter, if there is one, is then
  /// notified once when a retry may succeed, unless the job would not fit into an empty queue; or
  /// "deadline": by the estimates from similar jobs, it cannot end in time).
  [[nodiscard]] Expected<QueuePlace> admit(const std::shared_ptr<Job>& job,
                                           const std::weak_ptr<RoomWaiter>& waiter = {})
      ABSL_LOCKS_EXCLUDED(mutex_);

  /// Like admit(). If a worker is idle and similar jobs have been short, the job runs at once on the calling
  /// thread, in that worker's place: waking the worker takes longer than such a job. A job that is not done
  /// within kMostHere is begun again by a worker, with the same bits as result. Its work must allow a second
  /// call.
  [[nodiscard]] Expected<QueuePlace> admit_here(const std::shared_ptr<Job>& job) ABSL_LOCKS_EXCLUDED(mutex_);
  static constexpr std::chrono::milliseconds kMostHere{2};

  /// Returns the error with which admit() would refuse a job with this one's ticket and quota now; nothing
  /// if it would accept it. The job needs nothing else.
  [[nodiscard]] Expected<void> may_enter(const std::shared_ptr<Job>& job) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Number of jobs that would begin at once if they arrived now; negative if jobs are waiting.
  [[nodiscard]] int free_workers() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Sets the listener, which is notified whenever a job has ended.
  void set_room_listener(const std::weak_ptr<RoomWaiter>& listener) ABSL_LOCKS_EXCLUDED(mutex_);

  /// True if an empty queue would take the job.
  [[nodiscard]] bool fits_alone(const Job& job) const {
    return job.ticket.bytes <= std::min(limits_.bytes, job.quota.bytes);
  }

  /// Bytes of an update that waits in its session, counted while this object lives.
  class Held {
   public:
    Held(Scheduler& scheduler, std::string client, std::int64_t bytes)
        : scheduler_(scheduler), client_(std::move(client)), bytes_(bytes) {}
    ~Held() { scheduler_.release(client_, bytes_); }
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;

   private:
    Scheduler& scheduler_;
    const std::string client_;
    const std::int64_t bytes_;
  };
  /// Null if so many bytes exceed what is free in the queue or in the client's quota: JobQueue::hold().
  [[nodiscard]] std::unique_ptr<Held> hold(const std::string& client, std::int64_t bytes, const Quota& quota)
      ABSL_LOCKS_EXCLUDED(mutex_);

  /// The place of an array in the queue, and the bytes of its elements, while this object lives.
  class Place {
   public:
    Place(Scheduler& scheduler, std::string client, Quota quota, bool always)
        : scheduler_(scheduler), client_(std::move(client)), quota_(quota), always_(always) {}
    ~Place() { scheduler_.leave(client_, bytes_); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

    /// Called by one thread at a time. Errors: resource_exhausted (bytes, or the client's quota of them).
    [[nodiscard]] Expected<void> add_bytes(std::int64_t bytes);
    /// Of an element that has ended.
    void remove_bytes(std::int64_t bytes);

   private:
    Scheduler& scheduler_;
    const std::string client_;
    const Quota quota_;
    const bool always_;
    std::int64_t bytes_ = 0;
  };
  /// Takes one job of the client's quota for an array, whose elements are then `placed`. With `always`,
  /// limits are ignored. Errors: unavailable (draining), resource_exhausted (queue, or the client's quota).
  [[nodiscard]] Expected<std::unique_ptr<Place>> open_place(const std::string& client, Priority priority,
                                                            const Quota& quota, bool always)
      ABSL_LOCKS_EXCLUDED(mutex_);

  /// The client cancelled, or its deadline passed: a waiting job ends at once, a running one stops within
  /// 100 ms. No effect on a finished job.
  void cancel(const std::shared_ptr<Job>& job) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Counts a request that was refused before it became a job.
  void count_refused(const Error& error) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Announces that the scheduler will close soon: it still admits everything, but clients should go
  /// elsewhere.
  void announce_shutdown() ABSL_LOCKS_EXCLUDED(mutex_);
  /// True if closed, or about to close.
  [[nodiscard]] bool is_draining() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Admits nothing more from now on, except updates of sessions.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool is_closed() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// True if closed and every accepted job has its result.
  [[nodiscard]] bool is_drained() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Closes, then returns when every accepted job has its result. After `grace`, running solves are stopped
  /// and return their best iterate, and waiting jobs get unavailable.
  void drain(std::chrono::duration<double> grace) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Ends the grace period of a drain in progress now.
  void force_shutdown() ABSL_LOCKS_EXCLUDED(mutex_);

  /// Runs tasks of a running job on its own thread, and on workers that have nothing else to do.
  void run(std::span<const std::function<void()>> tasks) override ABSL_LOCKS_EXCLUDED(mutex_);

  /// Ends waiting jobs that can no longer meet their deadlines and, a few times a second, reports their
  /// places to the others.
  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_);

  [[nodiscard]] Counters counters() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Jobs and updates of sessions that got a result.
  [[nodiscard]] LastMinute::Sum last_minute() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// The same jobs: time from acceptance to result, over the last `seconds`.
  [[nodiscard]] Latencies::Quantiles latencies(std::int64_t seconds) const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] ClientShares client_shares() const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] const QueueLimits& limits() const { return limits_; }
  /// Returns when a refused request may be retried: after a full queue's worth of mean solves, when a worker
  /// is free; within [10 ms, 10 s].
  [[nodiscard]] double retry_delay_s() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the job's place in the queue; {0, 0} unless it waits.
  [[nodiscard]] QueuePlace place(const Job& job) const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void release(const std::string& client, std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_);
  void leave(const std::string& client, std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_);
  // With `here`, it returns whether the job has begun in the place of an idle worker.
  [[nodiscard]] Expected<QueuePlace> enqueue(const std::shared_ptr<Job>& job,
                                             const std::weak_ptr<RoomWaiter>& waiter, bool* here = nullptr)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void work() ABSL_LOCKS_EXCLUDED(mutex_);
  // Tasks of a running job; on its worker's stack, and in shared_tasks_ while some have not begun.
  struct SharedTasks {
    std::span<const std::function<void()>> tasks;
    std::size_t next = 0;
    int helpers = 0;
  };
  // The next job, or a task of another job to help with; neither of them means the end.
  struct Next {
    std::shared_ptr<Job> job;
    SharedTasks* shared = nullptr;
    const std::function<void()>* task = nullptr;
  };
  [[nodiscard]] Next next() ABSL_LOCKS_EXCLUDED(mutex_);
  class SteppingAside;
  class HereLimit;
  // Starts the job, which was queued just now, in the place of an idle worker; false if it must wait for
  // one.
  [[nodiscard]] bool begin_here(const std::shared_ptr<Job>& job) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void run_here(const std::shared_ptr<Job>& job) ABSL_LOCKS_EXCLUDED(mutex_);
  // Called on any thread that works for a job of lower priority: runs the next job above it, if there is one
  // that no idle worker takes. Returns whether it did.
  bool run_urgent(Job& paused, bool own_thread) ABSL_LOCKS_EXCLUDED(mutex_);
  void run_job(const std::shared_ptr<Job>& job) ABSL_LOCKS_EXCLUDED(mutex_);
  void end_job(const std::shared_ptr<Job>& job, Outcome outcome, Clock::duration paused)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void look_at_waiting() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] const std::function<void()>& begin_task(SharedTasks& shared)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void refuse_waiting(const std::vector<std::shared_ptr<Job>>& jobs, const Error& error, bool interrupted);
  void finish(Job& job, Outcome outcome, bool ran) ABSL_LOCKS_EXCLUDED(mutex_);
  void count(const Job& job, const Outcome& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void count_answer(const Outcome& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] QueuePlace place_of(const Job& job, const std::vector<double>& busy_s) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void estimate_run(Job& job, const RunEstimates::Key& key) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Whether a job can end by its deadline after this wait. If not, it may be tried unless it must be refused.
  struct Chance {
    bool is_likely = true;
    std::optional<Error> refusal = {};
  };
  [[nodiscard]] Chance chance_of(const Job& job, const RunEstimates::Key& key, double wait_s) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] Expected<void> check_deadline(const std::shared_ptr<Job>& job, const RunEstimates::Key& key,
                                              double wait_s) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void learn(const Job& job, const Outcome& outcome, double run_s) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Returns for how long each worker is likely to be busy with its job, in ascending order.
  [[nodiscard]] std::vector<double> busy_s() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] double wait_s(std::size_t ahead, double work_s, const std::vector<double>& busy_s) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Jobs that workers run now, without paused ones.
  [[nodiscard]] int running() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return queue_.running() - paused_;
  }
  [[nodiscard]] bool idle() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return queue_.waiting() == 0 && queue_.running() == 0 && finishing_ == 0;
  }

  const QueueLimits limits_;
  JobBoard& board_;
  const Log& log_;
  Metrics& metrics_;
  mutable Mutex mutex_;
  Condition work_;      // signals: a job was queued, a client's quota is free again, or stopping_
  Condition progress_;  // signals: a job ended, or the grace period did
  JobQueue<Job> queue_ ABSL_GUARDED_BY(mutex_);
  std::atomic<std::size_t> most_urgent_ = kPriorities;  // of what may preempt; read without the lock
  int idle_ ABSL_GUARDED_BY(mutex_) = 0;                // workers that wait for work
  int here_ ABSL_GUARDED_BY(mutex_) = 0;                // jobs that run in the place of an idle worker
  std::vector<std::shared_ptr<Job>> begun_here_ ABSL_GUARDED_BY(mutex_);  // jobs that took too long for it
  int paused_ ABSL_GUARDED_BY(mutex_) = 0;  // running jobs whose workers run others on top
  std::vector<std::shared_ptr<Job>> running_ ABSL_GUARDED_BY(mutex_);
  struct PlaceListener {
    std::weak_ptr<Job> job;
    std::weak_ptr<JobObserver> observer;
  };
  std::vector<PlaceListener> place_listeners_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::weak_ptr<RoomWaiter>> room_waiters_ ABSL_GUARDED_BY(mutex_);
  std::weak_ptr<RoomWaiter> room_listener_ ABSL_GUARDED_BY(mutex_);
  std::vector<SharedTasks*> shared_tasks_ ABSL_GUARDED_BY(mutex_);
  Condition helped_;                           // signals: a helper has ended its task
  int finishing_ ABSL_GUARDED_BY(mutex_) = 0;  // left queue or worker, observer not yet notified
  Counters counters_ ABSL_GUARDED_BY(mutex_);
  LastMinute last_minute_ ABSL_GUARDED_BY(mutex_);
  Latencies latencies_ ABSL_GUARDED_BY(mutex_);
  ClientUses client_uses_ ABSL_GUARDED_BY(mutex_);
  std::array<double, kPriorities> mean_run_s_ ABSL_GUARDED_BY(mutex_) = {};
  RunEstimates estimates_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point places_reported_ ABSL_GUARDED_BY(mutex_) = {};
  bool leaving_ ABSL_GUARDED_BY(mutex_) = false;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  bool hurried_ ABSL_GUARDED_BY(mutex_) = false;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> workers_;
};

}  // namespace marble::server
