// Submitted jobs on disk: what was accepted is there after a crash, and its answer too.
//
// One thread writes. What has come while it wrote the last time goes together into one transaction, so that
// many share one fsync (group commit).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "base/descriptor.h"
#include "log/log.h"
#include "mutex.h"
#include "store/sqlite.h"

namespace marble::server {

/// A job that has no answer yet.
struct StoredJob {
  std::string id = {};
  std::string client = {}, request_id = {};
  std::string digest = {};  ///< of the request, where it has an id
  std::string peer = {}, traceparent = {};
  std::int64_t priority = 0;
  double accepted_unix_s = 0.0;
  bool cancelled = false;    ///< it is to end, and not to run again
  std::string request = {};  ///< a marble.v1.SolveRequest; left out where jobs are listed
};

/// How one ended.
struct StoredResult {
  std::string id = {};
  std::string client = {}, request_id = {}, digest = {};  ///< read, not written: the job's
  std::string job = {};                                   ///< a marble.v1.GetJobResponse
  std::string answer = {};  ///< a marble.v1.SolveResponse; empty if there is none
  std::string error = {};   ///< a google.rpc.Status where there is no answer
  double finished_unix_s = 0.0;
};

/// Thread-safe. Every change is made in the order in which it was asked for.
class JobStore {
 public:
  /// Told once the change is on disk, or why it is not. On the store's thread, without a lock.
  using Settled = std::function<void(const Expected<void>&)>;

  /// Opens the directory's file, or makes both. Errors: unavailable (no such directory, not ours to write,
  /// another server has it, not a file of this kind, damaged, or of a later version).
  [[nodiscard]] static Expected<std::unique_ptr<JobStore>> open(const std::string& directory, const Log& log);
  /// What --check-state tells of it in one line: how many jobs wait and how many are answered. Looks through
  /// the whole file; while a server uses it too.
  [[nodiscard]] static Expected<std::string> check(const std::string& directory);
  /// Does what it was asked for, or as much of it as can be done now, and nothing from then on.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);
  ~JobStore() { close(); }
  JobStore(const JobStore&) = delete;
  JobStore& operator=(const JobStore&) = delete;

  /// Jobs without an answer, in the order in which they were accepted, without their requests.
  [[nodiscard]] Expected<std::vector<StoredJob>> unanswered() ABSL_LOCKS_EXCLUDED(read_mutex_);
  [[nodiscard]] Expected<std::string> request_of(const std::string& id) ABSL_LOCKS_EXCLUDED(read_mutex_);
  /// Tells all answers, in the order in which they came.
  [[nodiscard]] Expected<void> each_result(const std::function<void(StoredResult)>& tell)
      ABSL_LOCKS_EXCLUDED(read_mutex_);

  /// If this fails the job is not there. The others are tried again, once a second, until they are made.
  void add(StoredJob job, Settled settled) ABSL_LOCKS_EXCLUDED(mutex_);
  void finish(StoredResult result, Settled settled) ABSL_LOCKS_EXCLUDED(mutex_);
  /// It shall not run again.
  void cancel(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  void forget(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// When all that was asked for until now is made.
  void when_settled(Settled settled) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Why nothing could be written the last time, if so.
  [[nodiscard]] Expected<void> health() const ABSL_LOCKS_EXCLUDED(mutex_);
  struct Usage {
    bool written = true;  ///< what was tried last
    /// Transactions, what was asked for in them, and seconds they took; of those that were made.
    std::int64_t commits = 0, changes = 0;
    double commit_s = 0.0;
    std::int64_t bytes = 0;  ///< of the file, and of the log beside it that is not in it yet
  };
  [[nodiscard]] Usage usage() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Whether nothing is under way.
  [[nodiscard]] bool is_settled() const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  enum class Kind { add, finish, cancel, forget, nothing };
  struct Change {
    Kind kind = Kind::nothing;
    StoredJob job = {};
    StoredResult result = {};
    Settled settled = {};
  };
  JobStore(std::string file, Descriptor lock, Database writer, Database reader, const Log& log);
  void ask(Change change) ABSL_LOCKS_EXCLUDED(mutex_);
  void work() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool take(std::vector<Change>& changes) ABSL_LOCKS_EXCLUDED(mutex_);
  void count(const std::vector<Change>& changes, double seconds) ABSL_LOCKS_EXCLUDED(mutex_);
  void settle(std::vector<Change>& changes, const Expected<void>& made) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<void> write(std::vector<Change>& changes);
  [[nodiscard]] Expected<void> make(const Change& change);

  const Log& log_;
  const std::string file_;
  const Descriptor lock_;  // of the directory, for as long as this lives
  Database writer_;        // the thread's
  Mutex read_mutex_;
  Database reader_ ABSL_GUARDED_BY(read_mutex_);
  mutable Mutex mutex_;
  Condition wake_;
  std::vector<Change> changes_ ABSL_GUARDED_BY(mutex_);
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  Expected<void> health_ ABSL_GUARDED_BY(mutex_);
  Usage usage_ ABSL_GUARDED_BY(mutex_);  // its counts
  std::thread thread_;
};

}  // namespace marble::server
