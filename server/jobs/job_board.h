// Every job by its id: those that wait or run, and a bounded history of those that have finished.
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
  int history_jobs = 1000;  ///< finished jobs that are remembered
  int trace_rows = 256;     ///< of each job
  int trace_pairs = 128;    ///< of a problem whose sides are kept
};

/// Thread-safe.
class JobBoard {
 public:
  using Record = std::shared_ptr<JobRecord>;
  using Filter = std::function<bool(const JobRecord&)>;

  explicit JobBoard(const BoardLimits& limits) : limits_(limits) {}

  /// A record of a job that is about to be admitted; nobody sees it yet.
  [[nodiscard]] Record make(JobDescription description, const Options& options) const;
  /// Now everybody does. Nothing, if it is there.
  void add(const Record& record) ABSL_LOCKS_EXCLUDED(mutex_);
  /// It has finished; the oldest finished ones beyond the limit are forgotten.
  void finish(const Record& record) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Nobody finds it any more. One that has not finished stays active until it has, for those who watch.
  void forget(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);

  [[nodiscard]] Record find(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);
  struct Page {
    std::vector<Record> records;
    bool more = false;
  };
  /// Newest first, at most `limit` that are visible and pass the filter, those accepted before `before_id`
  /// unless that is empty. Not found if it is not there or not visible, in the same words.
  [[nodiscard]] Expected<Page> list(const Filter& visible, const Filter& filter, std::size_t limit,
                                    const std::string& before_id) const ABSL_LOCKS_EXCLUDED(mutex_);

  using Records = std::shared_ptr<const std::vector<Record>>;
  /// Those that have not finished, in the order of acceptance. One list for all who ask, the same until a job
  /// comes or goes.
  [[nodiscard]] Records active() const ABSL_LOCKS_EXCLUDED(mutex_);
  struct Finished {
    std::vector<Record> records;  ///< in the order they finished
    std::int64_t skipped = 0;     ///< that are forgotten already
  };
  /// Those that have finished since the cursor, which moves on.
  [[nodiscard]] Finished finished_since(std::int64_t& cursor) const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::int64_t finished() const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void remove(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const BoardLimits limits_;
  mutable Mutex mutex_;
  std::map<std::int64_t, Record> records_ ABSL_GUARDED_BY(mutex_);  // by order of acceptance
  std::unordered_map<std::string, std::int64_t> numbers_ ABSL_GUARDED_BY(mutex_);
  std::map<std::int64_t, Record> active_ ABSL_GUARDED_BY(mutex_);
  mutable Records active_list_ ABSL_GUARDED_BY(mutex_);  // of active_; null: to be made anew
  std::deque<Record> finished_ ABSL_GUARDED_BY(mutex_);
  std::int64_t next_number_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t finished_count_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::server
