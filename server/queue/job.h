// One admitted piece of work on its way through queue and worker.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>

#include "jobs/job_record.h"
#include "marble/solver.h"
#include "queue/job_queue.h"
#include "queue/run_estimates.h"

namespace marble::v1 {
class Solution;
}  // namespace marble::v1

namespace marble::server {

[[nodiscard]] inline double seconds(Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

/// What an answer says besides its solution, where the request is made of many problems.
using AlsoSaid = std::function<void(v1::Solution*)>;

/// How a job ended: an answer, whatever its status, or why there is none.
struct Outcome {
  Expected<Solution> solution = unexpected(Error{});
  double queue_s = 0.0;
  double total_s = 0.0;
  double retry_delay_s = 0.0;  ///< for errors that say "try again"
  AlsoSaid also = nullptr;     ///< of an answer; null if there is nothing more
  bool interrupted = false;    ///< it did not come to its end: the server stops
};

/// The error of a job that needs more memory than there is.
[[nodiscard]] inline Error does_not_fit() {
  return failure(ErrorCode::resource_exhausted, "problem", "does not fit the server's memory");
}

/// Jobs that run for about as long.
[[nodiscard]] inline RunEstimates::Key key_of(const Ticket& ticket) {
  return {ticket.client, ticket.priority, ticket.work_class};
}

/// Who waits for a job. Called by one thread at a time, but for moved(); finished() exactly once, as the
/// last.
class JobObserver {
 public:
  virtual ~JobObserver() = default;
  /// Its place in the queue has changed. Only if wants_place().
  virtual void moved(const QueuePlace& /*place*/) {}
  [[nodiscard]] virtual bool wants_place() const { return false; }
  /// A worker took the job.
  virtual void started(double /*queue_s*/) {}
  /// Where progress goes besides the job's record; null if nobody looks.
  virtual ProgressSink* progress() { return nullptr; }
  virtual void finished(Outcome outcome) = 0;
};

struct Job {
  std::shared_ptr<JobRecord> record;  ///< what is known of it, for others
  Ticket ticket;
  Quota quota;  ///< of its client
  /// What a worker does. It owns what it needs, and is freed before the observer hears of the end.
  std::function<Expected<Solution>(const SolveControls&)> work;
  AlsoSaid also = nullptr;                          ///< once its work is done
  std::shared_ptr<JobObserver> observer = nullptr;  ///< let go after finished()
  double time_limit_s = 1e9;                        ///< after which its work ends by itself
  bool is_interrupted = false;                      ///< the scheduler's own: its stop is the server's
  bool has_started = false;                         ///< the scheduler's own: its observer knows
  bool is_paused = false;       ///< the scheduler's own: its worker runs a more urgent one
  bool is_setup = false;        ///< of a session: prepares, solves nothing, and is not counted
  bool is_preparation = false;  ///< the same of an update's first part
  Clock::time_point accepted = Clock::now();
  Clock::time_point begun = {};  ///< when a worker took it
  std::stop_source stop = {};
};

/// Whether its answer is one that a client waits for.
[[nodiscard]] inline bool solves(const Job& job) { return !job.is_setup && !job.is_preparation; }

}  // namespace marble::server
