// One admitted job on its way through queue and worker.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>

#include "jobs/job_queue.h"
#include "jobs/job_record.h"
#include "jobs/run_estimates.h"
#include "marble/solver.h"

namespace marble::v1 {
class Solution;
}  // namespace marble::v1

namespace marble::server {

[[nodiscard]] inline double seconds(Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

/// Adds to a solution what a request with many problems returns besides it.
using AlsoSaid = std::function<void(v1::Solution*)>;

/// How a job ended: with a solution of any status, or with an error.
struct Outcome {
  Expected<Solution> solution = unexpected(Error{});
  double queue_s = 0.0;
  double total_s = 0.0;
  double retry_delay_s = 0.0;  ///< for errors that ask the client to retry
  AlsoSaid also = nullptr;     ///< adds to a solution; null if there is nothing more
  bool interrupted = false;    ///< the job did not finish because the server stops
};

/// Returns the error of a job that needs more memory than is available.
[[nodiscard]] inline Error does_not_fit() {
  return failure(ErrorCode::resource_exhausted, "problem", "does not fit the server's memory");
}

/// Returns the key that is shared by jobs that run for about as long.
[[nodiscard]] inline RunEstimates::Key key_of(const Ticket& ticket) {
  return {ticket.client, ticket.priority, ticket.work_class};
}

/// The object that waits for a job. Called by one thread at a time, except for moved(); finished() is called
/// exactly once, as the last.
class JobObserver {
 public:
  virtual ~JobObserver() = default;
  /// Its place in the queue has changed. Called only if wants_place() is true.
  virtual void moved(const QueuePlace& /*place*/) {}
  [[nodiscard]] virtual bool wants_place() const { return false; }
  /// A worker has taken the job.
  virtual void started(double /*queue_s*/) {}
  /// Returns where progress goes besides the job's record; null if nothing else receives it.
  virtual ProgressSink* progress() { return nullptr; }
  virtual void finished(Outcome outcome) = 0;
};

struct Job {
  std::shared_ptr<JobRecord> record;  ///< the job's state as other threads see it
  Ticket ticket;
  Quota quota;  ///< quota of its client
  /// The work of a worker. It owns what it needs, and is freed before the observer is notified of the end.
  std::function<Expected<Solution>(const SolveControls&)> work;
  AlsoSaid also = nullptr;                          ///< called once its work is done
  std::shared_ptr<JobObserver> observer = nullptr;  ///< released after finished()
  double time_limit_s = 1e9;                        ///< limit after which its work ends by itself
  bool is_interrupted = false;                      ///< scheduler only: stopped because the server stops
  bool has_started = false;                         ///< scheduler only: the observer was notified
  bool is_paused = false;                           ///< scheduler only: its worker runs a more urgent job
  bool is_setup = false;        ///< job of a session that prepares, solves nothing, and is not counted
  bool is_preparation = false;  ///< the same, for the preparation phase of an update
  Clock::time_point accepted = Clock::now();
  Clock::time_point begun = {};  ///< when a worker took it
  std::stop_source stop = {};
};

/// True if the job produces a result that a client waits for.
[[nodiscard]] inline bool solves(const Job& job) { return !job.is_setup && !job.is_preparation; }

}  // namespace marble::server
