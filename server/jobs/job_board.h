// All jobs by id: those that wait or run, and a bounded history of the finished ones.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "jobs/job_record.h"

namespace marble::server {

struct BoardLimits {
  int history_jobs = 1000;  ///< finished jobs that are kept
  int trace_rows = 256;     ///< maximum trace length of each job
  int trace_pairs = 128;    ///< pairs of a problem whose sides are kept
};

/// Thread-safe.
class JobBoard {
 public:
  using Record = std::shared_ptr<JobRecord>;
  using Filter = std::function<bool(const JobRecord&)>;

  explicit JobBoard(const BoardLimits& limits) : limits_(limits) {}

  /// Makes the record of a job that is about to be admitted; no one sees it yet.
  [[nodiscard]] Record make(JobDescription description, const Options& options) const;
  /// Makes it visible. No effect if it is there already.
  void add(const Record& record) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Marks it as finished; the oldest finished jobs beyond the limit are removed.
  void finish(const Record& record) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Removes it from the index. A job that has not finished stays active until it has, for its watchers.
  void forget(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);

  [[nodiscard]] Record find(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);
  struct Page {
    std::vector<Record> records;
    bool more = false;
  };
  /// Returns at most `limit` jobs, newest first, that are visible and pass the filter, accepted before
  /// `before_id` unless that is empty. If `before_id` does not exist or is not visible, the error is the
  /// same not_found.
  [[nodiscard]] Expected<Page> list(const Filter& visible, const Filter& filter, std::size_t limit,
                                    const std::string& before_id) const ABSL_LOCKS_EXCLUDED(mutex_);

  using Records = std::shared_ptr<const std::vector<Record>>;
  /// Returns the unfinished jobs in order of acceptance. All callers share one list, which is the same until
  /// a job arrives or ends.
  [[nodiscard]] Records active() const ABSL_LOCKS_EXCLUDED(mutex_);
  struct Finished {
    std::vector<Record> records;  ///< in the order in which they finished
    std::int64_t skipped = 0;     ///< number of those that were removed already
  };
  /// Returns the jobs that have finished since the cursor, and advances it.
  [[nodiscard]] Finished finished_since(std::int64_t& cursor) const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::int64_t finished() const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void remove(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const BoardLimits limits_;
  mutable Mutex mutex_;
  std::map<std::int64_t, Record> records_ ABSL_GUARDED_BY(mutex_);  // key: order of acceptance
  std::unordered_map<std::string, std::int64_t> numbers_ ABSL_GUARDED_BY(mutex_);
  std::map<std::int64_t, Record> active_ ABSL_GUARDED_BY(mutex_);
  mutable Records active_list_ ABSL_GUARDED_BY(mutex_);  // list of active_; null: must be rebuilt
  std::deque<Record> finished_ ABSL_GUARDED_BY(mutex_);
  std::int64_t next_number_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t finished_count_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::server
