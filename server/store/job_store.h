// Submitted jobs on disk: what was accepted is there after a crash, and its answer too.
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

/// A job that has no answer yet.
struct StoredJob {
  std::string id = {};
  std::string client = {}, request_id = {};
  std::string digest = {};  ///< of the request, where it has an id
  std::string peer = {}, traceparent = {};
  std::int64_t priority = 0;
  double accepted_unix_s = 0.0;
  std::int64_t lost = 0;           ///< starts whose server stopped meanwhile
  bool cancelled = false;          ///< it is to end, and not to run again
  std::string request = {};        ///< a marble.v1.SolveRequest; left out where jobs are listed
  std::int64_t request_bytes = 0;  ///< of it, where jobs are listed
  /// Of an array how many; 0 while they come. Nothing of other jobs.
  std::optional<std::int64_t> elements = {};
};

/// How one ended.
struct StoredResult {
  std::string id = {};
  std::string client = {}, request_id = {}, digest = {};  ///< read, not written: the job's
  std::string job = {};                                   ///< a marble.v1.GetJobResponse
  std::string answer = {};  ///< a marble.v1.SolveResponse; empty if there is none
  std::string error = {};   ///< a google.rpc.Status where there is no answer
  double finished_unix_s = 0.0;
  std::string info = {};  ///< a marble.v1.JobInfo: the job's without its trace, where several servers list it
  bool keeps_request = false;                 ///< the request stays with the answer
  std::int64_t request_bytes = -1;            ///< read, not written: of the request, if it is there
  std::optional<std::int64_t> elements = {};  ///< read, not written: as StoredJob has it
};

/// The job in a row of JobStore::unanswered(), and the answer in one of JobStore::each_result(). A column may
/// be of any type.
[[nodiscard]] StoredJob job_in(const Statement& row);
[[nodiscard]] StoredResult result_in(const Statement& row);

/// Thread-safe. Every change is made in the order in which it was asked for.
class JobStore final : public ElementStore {
 public:
  /// Opens the directory's file, or makes both. Errors: unavailable (no such directory, not ours to write,
  /// another server has it, not a file of this kind, damaged, or of a later version).
  [[nodiscard]] static Expected<std::unique_ptr<JobStore>> open(const std::string& directory, const Log& log);
  /// What --check-state tells of it in one line: how many jobs wait and how many are answered. Looks through
  /// the whole file; while a server uses it too.
  [[nodiscard]] static Expected<std::string> check(const std::string& directory);
  /// Does what it was asked for, or as much of it as can be done now, and nothing from then on.
  void close() { changes_.close(); }
  JobStore(const JobStore&) = delete;
  JobStore& operator=(const JobStore&) = delete;

  /// Jobs without an answer, in the order in which they were accepted, without their requests.
  [[nodiscard]] Expected<std::vector<StoredJob>> unanswered() ABSL_LOCKS_EXCLUDED(read_mutex_);
  /// Errors: not_found (it is not there, or not any more).
  [[nodiscard]] Expected<std::string> request_of(const std::string& id) ABSL_LOCKS_EXCLUDED(read_mutex_);
  /// Tells all answers, in the order in which they came.
  [[nodiscard]] Expected<void> each_result(const std::function<void(StoredResult)>& tell)
      ABSL_LOCKS_EXCLUDED(read_mutex_);

  /// The job runs from here to there; a crash in between is counted when the file is opened again.
  void began(const JobStart& start) override { running_.began(start); }
  void ended(const std::string& id) override { running_.ended(id); }

  /// If this fails the job is not there. The others are tried again, once a second, until they are made.
  void add(StoredJob job, Settled settled);
  void finish(StoredResult result, Settled settled) override;
  /// It shall not run again.
  void cancel(const std::string& id) override;
  void forget(const std::string& id) override;
  /// The answer stays.
  void forget_request(const std::string& id);
  /// When all that was asked for until now is made.
  void when_settled(Settled settled) override;

  // Arrays. An answer is tried again until it is kept, and told only then.
  void open_array(StoredJob array, Settled settled) override;
  void add_element(StoredElement element, Settled settled) override;
  void seal_array(const std::string& id, std::int64_t elements, const std::string& digest,
                  Settled settled) override;
  [[nodiscard]] Expected<std::string> element(const std::string& array, std::int64_t index) override
      ABSL_LOCKS_EXCLUDED(read_mutex_);
  void answer_element(ElementAnswer answer, Settled settled) override;
  [[nodiscard]] Expected<std::vector<ElementAnswer>> answers_after(const std::string& array,
                                                                   std::int64_t after,
                                                                   std::int64_t most_bytes) override
      ABSL_LOCKS_EXCLUDED(read_mutex_);
  [[nodiscard]] bool is_durable() const override { return true; }
  /// Tells what is known of each element that is there, in their order.
  [[nodiscard]] Expected<void> each_element(const std::string& array,
                                            const std::function<void(const ElementRow&)>& tell)
      ABSL_LOCKS_EXCLUDED(read_mutex_);

  /// Why nothing could be written the last time, if so.
  [[nodiscard]] Expected<void> health() const { return changes_.health(); }
  /// Its bytes are those of the file, and of the log beside it that is not in it yet.
  [[nodiscard]] StoreUsage usage() const;
  /// Whether nothing is under way.
  [[nodiscard]] bool is_settled() const { return changes_.is_settled(); }

 private:
  enum class Kind { add, finish, cancel, forget, forget_request, add_element, seal, answer_element, nothing };
  struct Change {
    Kind kind = Kind::nothing;
    StoredJob job = {};
    StoredResult result = {};
    StoredElement element = {};
    ElementAnswer answer = {};
    Settled settled = {};
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
  const Descriptor lock_;  // of the directory, for as long as this lives
  RunningJobs running_;
  Database writer_;  // the writer's thread's
  Mutex read_mutex_;
  Database reader_ ABSL_GUARDED_BY(read_mutex_);
  GroupWriter<Change> changes_;
};

}  // namespace marble::server
