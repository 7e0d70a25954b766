// Submitted jobs on disk: accepted jobs and their results survive a crash.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "store/array_rows.h"
#include "store/element_store.h"
#include "store/group_writer.h"
#include "store/running_jobs.h"
#include "store/sqlite.h"

namespace marble::server {

/// A job that has no result yet.
struct StoredJob {
  std::string id = {};
  std::string client = {}, request_id = {};
  std::string digest = {};  ///< digest of the request, if it has an id
  std::string peer = {}, traceparent = {};
  std::int64_t priority = 0;
  double accepted_unix_s = 0.0;
  std::int64_t lost = 0;           ///< starts during which the server died
  bool cancelled = false;          ///< it must end, and not run again
  std::string request = {};        ///< a marble.v1.SolveRequest; left out in lists of jobs
  std::int64_t request_bytes = 0;  ///< size of the request, in lists of jobs
  /// Number of elements of an array; 0 while they are being received. Empty for other jobs.
  std::optional<std::int64_t> elements = {};
};

/// How a job ended.
struct StoredResult {
  std::string id = {};
  std::string client = {}, request_id = {}, digest = {};  ///< only read: as in the job
  std::string job = {};                                   ///< a marble.v1.GetJobResponse
  std::string answer = {};  ///< a marble.v1.SolveResponse; empty if there is none
  std::string error = {};   ///< a google.rpc.Status if there is no result
  double finished_unix_s = 0.0;
  std::string info = {};  ///< a marble.v1.JobInfo: the job's without its trace, for lists of several servers
  std::int64_t element_bytes = 0;             ///< only written: bytes of the results of an array's elements
  bool keeps_request = false;                 ///< the request stays with the result
  std::int64_t request_bytes = -1;            ///< only read: size of the request, if it is kept
  std::optional<std::int64_t> elements = {};  ///< only read: as in StoredJob
};

/// Return the job in a row of JobStore::unanswered(), and the result in one of JobStore::each_result(). A
/// column may be of any type.
[[nodiscard]] StoredJob job_in(const Statement& row);
[[nodiscard]] StoredResult result_in(const Statement& row);

/// Thread-safe. Changes are made in the order of the calls.
class JobStore final : public ArrayStore {
 public:
  /// Opens the directory's file, or creates both. Errors: unavailable (no such directory, no permission to
  /// write, in use by another server, not a file of this kind, damaged, or of a later version).
  [[nodiscard]] static Expected<std::unique_ptr<JobStore>> open(const std::string& directory, const Log& log);
  /// Returns the line of --check-state: how many jobs wait and how many have results. Checks the whole file,
  /// also while a server uses it.
  [[nodiscard]] static Expected<std::string> check(const std::string& directory);
  /// Does the pending changes, or as many as can be done now, and nothing from then on.
  void close() { changes_.close(); }
  JobStore(const JobStore&) = delete;
  JobStore& operator=(const JobStore&) = delete;

  /// Returns the jobs without a result, in order of acceptance, without their requests.
  [[nodiscard]] Expected<std::vector<StoredJob>> unanswered() ABSL_LOCKS_EXCLUDED(read_mutex_);
  /// Errors: not_found (it does not exist, or not any more).
  [[nodiscard]] Expected<std::string> request_of(const std::string& id) ABSL_LOCKS_EXCLUDED(read_mutex_);
  /// Calls `report` for all results, in the order in which they came.
  [[nodiscard]] Expected<void> each_result(const std::function<void(StoredResult)>& report)
      ABSL_LOCKS_EXCLUDED(read_mutex_);

  /// Marks the time in which the job runs; a crash in between is counted when the file is opened again.
  void began(const JobStart& start) override { running_.began(start); }
  void ended(const std::string& id) override { running_.ended(id); }

  /// If this fails, the job is not stored. The other changes are retried, once a second, until they succeed.
  void add(StoredJob job, CompletionCallback settled);
  void finish(StoredResult result, CompletionCallback settled) override;
  /// Prevents it from running again.
  void cancel(const std::string& id) override;
  void forget(const std::string& id) override;
  /// The result stays.
  void forget_request(const std::string& id);
  /// Calls back when all earlier changes are done.
  void when_settled(CompletionCallback settled) override;

  // Arrays. A result is retried until it is kept, and reported only then.
  void open_array(StoredJob array, CompletionCallback settled) override;
  void add_element(StoredElement element, CompletionCallback settled) override;
  void seal_array(const std::string& id, std::int64_t elements, const std::string& digest,
                  CompletionCallback settled) override;
  [[nodiscard]] Expected<std::string> element(const std::string& array, std::int64_t index) override
      ABSL_LOCKS_EXCLUDED(read_mutex_);
  void answer_element(ElementAnswer answer, CompletionCallback settled) override;
  [[nodiscard]] Expected<std::vector<ElementAnswer>> answers_after(const std::string& array,
                                                                   std::int64_t after,
                                                                   std::int64_t most_bytes) override
      ABSL_LOCKS_EXCLUDED(read_mutex_);
  [[nodiscard]] bool is_durable() const override { return true; }
  /// Calls `report` for each existing element, in order.
  [[nodiscard]] Expected<void> each_element(const std::string& array,
                                            const std::function<void(const ElementRow&)>& report)
      ABSL_LOCKS_EXCLUDED(read_mutex_);

  /// The error of the last write, if it failed.
  [[nodiscard]] Expected<void> health() const { return changes_.health(); }
  /// The bytes include the file and the part of its log that is not in it yet.
  [[nodiscard]] StoreUsage usage() const;
  /// True if nothing is in progress.
  [[nodiscard]] bool is_settled() const { return changes_.is_settled(); }

 private:
  enum class Kind { add, finish, cancel, forget, forget_request, add_element, seal, answer_element, nothing };
  struct Change {
    Kind kind = Kind::nothing;
    StoredJob job = {};
    StoredResult result = {};
    StoredElement element = {};
    ElementAnswer answer = {};
    CompletionCallback settled = {};
    [[nodiscard]] bool is_change() const { return kind != Kind::nothing; }
    [[nodiscard]] bool is_patient() const { return kind == Kind::answer_element; }
    [[nodiscard]] bool is_lasting() const {
      return kind != Kind::nothing && kind != Kind::add && kind != Kind::add_element && kind != Kind::seal;
    }
  };
  JobStore(std::string file, Descriptor lock, RunningJobs running, Database writer, Database reader,
           const Log& log);
  [[nodiscard]] Expected<void> write(std::vector<Change>& changes);
  [[nodiscard]] Expected<void> make(const Change& change);

  const std::string file_;
  const Descriptor lock_;  // lock on the directory, held while this object lives
  RunningJobs running_;
  Database writer_;  // used by the writer's thread
  Mutex read_mutex_;
  Database reader_ ABSL_GUARDED_BY(read_mutex_);
  GroupWriter<Change> changes_;
};

}  // namespace marble::server
