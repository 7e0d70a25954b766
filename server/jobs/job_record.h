// The state of a job from its acceptance until its record is removed: for lists, watchers and logs.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/priority.h"
#include "base/trace_context.h"
#include "jobs/infeasibility.h"
#include "jobs/pair_history.h"
#include "jobs/progress_history.h"
#include "marble/composite/scenarios.h"
#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/solution.h"
#include "mutex.h"

namespace marble::server {

enum class JobKind { solve, batch, submitted, session, scenarios, coupled, array };
enum class JobState { queued, running, idle, finished };

/// True if a job of this kind does not end with the call that submitted it.
[[nodiscard]] constexpr bool outlives_call(JobKind kind) {
  return kind == JobKind::submitted || kind == JobKind::array;
}

/// Properties that do not change during a job's life.
struct JobDescription {
  std::string id = {};
  JobKind kind = JobKind::solve;
  Priority priority = Priority::interactive;
  std::string client = {};                            ///< who may see it, besides observers
  std::string request_id = {}, name = {}, peer = {};  ///< as the client gave them
  Index variables = 0, equalities = 0, inequalities = 0, pairs = 0;
  std::optional<TraceContext> trace = {};  ///< trace of the call that submitted it
  std::chrono::system_clock::time_point accepted = std::chrono::system_clock::now();
};

/// The place of a job that waits.
struct QueuePlace {
  int position = 0;               ///< jobs that will be taken before it, by the current state
  double estimated_wait_s = 0.0;  ///< estimate from the mean of recent solves
};

/// Progress of an array.
struct ArrayCounts {
  std::int64_t elements = 0;
  std::int64_t done = 0, solved = 0, failed = 0;  ///< done: with a result or an error
  std::int64_t iterations = 0, factorizations = 0;
};

/// Properties that change.
struct JobSnapshot {
  JobState state = JobState::queued;
  std::optional<Status> status;  ///< status of the result; in a session, of the newest result
  std::optional<Error> error;    ///< why there is no result
  std::int64_t iterations = 0, factorizations = 0;
  double objective = 0.0;
  Violations violations;
  double incumbent =
      std::numeric_limits<double>::infinity();  ///< of a tree (option global_search), as in Progress
  double bound = -std::numeric_limits<double>::infinity();
  double gap = std::numeric_limits<double>::infinity();
  std::int64_t nodes = 0, open_nodes = 0;
  bool proved = false;
  Times times;
  double queue_s = 0.0, total_s = 0.0;
  std::int64_t updates = 0;
  std::int64_t memory_bytes = 0, result_bytes = 0;
  std::vector<SampleAverageStage> stages = {};              ///< stages of a scenario solve, without x
  std::string detail = {};                                  ///< the numbers that justify the status
  std::shared_ptr<const Infeasibility> infeasibility = {};  ///< null unless the status is infeasible
  std::optional<ArrayCounts> array = {};                    ///< set only for an array
  std::string server = {};  ///< if several share a store: which runs it, or ran it last
  std::optional<std::chrono::system_clock::time_point> finished = {};  ///< when it finished, if it has
  std::int64_t version = 0;  ///< grows with every change except progress
};

/// Written by the worker, read by any number of threads.
class JobRecord final : public ProgressSink {
 public:
  /// Keeps `trace_rows` rows, and the sides of the pairs, as an even sample if there are more than
  /// `trace_pairs`.
  JobRecord(JobDescription description, const Options& options, int trace_rows, int trace_pairs = 0);

  [[nodiscard]] const JobDescription& description() const { return description_; }
  [[nodiscard]] const std::string& id() const { return description_.id; }

  void queued() ABSL_LOCKS_EXCLUDED(mutex_);
  void started(double queue_s) ABSL_LOCKS_EXCLUDED(mutex_);
  /// A session waits for its next update.
  void idle() ABSL_LOCKS_EXCLUDED(mutex_);
  void set_memory(std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_);
  void set_options(const Options& options) ABSL_LOCKS_EXCLUDED(mutex_);
  void report(const Progress& progress) override ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool wants_pairs() const override { return wants_pairs_; }
  /// The current activity of its solve.
  [[nodiscard]] ActivityMonitor& activity() { return activity_; }
  [[nodiscard]] const ActivityMonitor& activity() const { return activity_; }
  /// Adds a finished stage of a scenario solve.
  void add_stage(const SampleAverageStage& stage) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the stages from number `first` on.
  [[nodiscard]] std::vector<SampleAverageStage> stages_from(std::size_t first) const
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Records the end of one solve of a session.
  void answered(const Expected<Solution>& solution, double total_s) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Records the end of the job.
  void finished(const Expected<Solution>& solution, double queue_s, double total_s)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Records the end of a session: the reason, or nothing if its client closed it.
  void closed(const std::optional<Error>& reason) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Records that elements of an array have ended; its results take `result_bytes`.
  void set_array(const ArrayCounts& counts, std::int64_t result_bytes) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Records the end of an array: the reason, if it ended before all its elements.
  void array_ended(const std::optional<Error>& reason, double total_s) ABSL_LOCKS_EXCLUDED(mutex_);
  void set_result_bytes(std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_);
  struct Trace {
    std::vector<Progress> rows;
    int stride = 1;
    std::int64_t cursor = 0;  ///< position to read on from
    std::vector<PairHistory::Frame> pairs = {};
  };
  /// Restores the state that it had when it finished, before the server restarted, or its state on another
  /// server. Without rows or pairs, the existing ones stay.
  void restore(JobSnapshot snapshot, Trace trace) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Appends rows of another server, after `skipped` rows that are not reported.
  void follow(std::int64_t skipped, const std::vector<Progress>& rows) ABSL_LOCKS_EXCLUDED(mutex_);
  void set_server(const std::string& server) ABSL_LOCKS_EXCLUDED(mutex_);

  [[nodiscard]] JobSnapshot snapshot() const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool is_finished() const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool is_running() const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Options options() const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Trace trace() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Changes with every change, including progress.
  [[nodiscard]] std::int64_t changes() const {
    return changes_.load(std::memory_order_acquire) + activity_.changes();
  }
  [[nodiscard]] ProgressHistory::Rows read(std::int64_t& cursor) const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Progress newest() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Empty if its pairs are not kept, or none were reported yet.
  [[nodiscard]] std::optional<PairHistory::Frame> newest_pairs() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// While there are watchers, its newest rows are kept even after it has finished.
  void watch(bool begin) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool is_watched() const ABSL_LOCKS_EXCLUDED(mutex_);

  /// Sets how to request its end and its place; called by the owner, empty once the job has finished.
  void set_cancel(std::function<void()> cancel) ABSL_LOCKS_EXCLUDED(mutex_);
  void set_place(std::function<QueuePlace()> place) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] QueuePlace place() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Requests its end. No effect on a finished job.
  void cancel() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  using Why = std::shared_ptr<const Infeasibility>;
  [[nodiscard]] Why why_of(const Expected<Solution>& solution) const;
  void take(const Solution& solution, Why why) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  template <class Reported>
  void take_tree(const Reported& reported) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void end() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void changed() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const JobDescription description_;
  const bool wants_pairs_;
  std::atomic<std::int64_t> changes_ = 0;
  ActivityMonitor activity_;
  mutable Mutex mutex_;
  Options options_ ABSL_GUARDED_BY(mutex_);
  JobSnapshot snapshot_ ABSL_GUARDED_BY(mutex_);
  std::int64_t earlier_iterations_ ABSL_GUARDED_BY(mutex_) = 0;  // of earlier solves of the session
  std::int64_t earlier_factorizations_ ABSL_GUARDED_BY(mutex_) = 0;
  ProgressHistory history_ ABSL_GUARDED_BY(mutex_);
  PairHistory pairs_ ABSL_GUARDED_BY(mutex_);
  int watchers_ ABSL_GUARDED_BY(mutex_) = 0;
  std::function<void()> cancel_ ABSL_GUARDED_BY(mutex_);
  std::function<QueuePlace()> place_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
