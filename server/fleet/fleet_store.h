// The writes of one server to a shared store: one transaction for all changes that arrived meanwhile.
//
// Jobs are taken under row locks that other servers skip; bounds and request ids are checked under one lock
// of all servers, for the length of that transaction. All times are the database's, because the servers'
// clocks may differ.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fleet/fleet_schema.h"
#include "jobs/job_queue.h"
#include "jobs/job_record.h"
#include "store/group_writer.h"
#include "store/job_store.h"

namespace marble::server {

/// A job to be admitted, or an array that is being received.
struct FleetJob {
  StoredJob stored;
  Quota quota;             ///< quota of its client
  std::string info;        ///< a marble.v1.JobInfo
  std::string token = {};  ///< of an array: only its holder may add elements
  /// Set when `settled` reports success: the id, of an earlier job if it exists already, or why the job is
  /// refused. Read on the store's thread only.
  Expected<std::string> id = unexpected(Error{});
  int position = 0;
};

/// What the store has of an array that was taken.
struct StoredElements {
  std::int64_t rows = 0;
  ArrayCounts counts = {};
  std::int64_t answer_bytes = 0, request_bytes = 0, last_sequence = 0;
};

/// Elements that are claimed for an array's server.
struct ElementClaim {
  std::string id, token;
  std::int64_t number = 0;  ///< new for each claim under this token
  bool suspect = false;     ///< one of those that were claimed when a server died
  std::int64_t most = 0;    ///< otherwise: how many
  bool is_held = false;     ///< set when `settled` reports success, as is `elements`: the token is valid
  std::vector<ClaimedElement> elements = {};
};

/// A job that this server has taken.
struct TakenJob {
  StoredJob stored;
  std::int64_t number = 0;
  double age_s = 0.0;
  int lost = 0;                  ///< servers that died while running it
  std::string token;             ///< its holder may write the result
  std::string info;              ///< a marble.v1.JobInfo
  StoredElements elements = {};  ///< of an array, which has `stored.elements`
};

/// Returns the job in a row that was taken. A column may contain any value of its type.
[[nodiscard]] TakenJob taken_in(const PgRows& rows, int row);
/// Return an array's elements in a row of kElements, a claim in the rows of kClaim, and the results in those
/// of kArrayAnswers. A column may contain any value of its type.
[[nodiscard]] StoredElements elements_in(const PgRows& rows, std::int64_t elements);
void read_claim(const PgRows& rows, ElementClaim& claim);
[[nodiscard]] std::vector<ElementAnswer> answers_in(const PgRows& rows, const std::string& array);

/// The reported state of a running job.
struct LiveJob {
  std::int64_t number = 0;
  std::string token;
  std::int64_t first = 0, upto = 0;  ///< range of its rows: [first, upto)
  std::string rows, info, job;       ///< JobEvent, JobInfo, GetJobResponse of marble.v1
  bool is_array = false;
  std::int64_t request_bytes = 0, answer_bytes = 0;  ///< of an array: what counts in the limits
};

/// Takes jobs. Called by the store's thread.
class FleetTaker {
 public:
  virtual ~FleetTaker() = default;
  struct Room {
    int jobs = 0;
    bool suspect = false;  ///< one of them may be a job during which a server died
  };
  /// Returns how many it takes now.
  [[nodiscard]] virtual Room room() = 0;
  [[nodiscard]] virtual Quota quota_of(const std::string& client) = 0;
  virtual void took(std::vector<TakenJob> jobs) = 0;
  /// Returns the ids and tokens of its jobs.
  [[nodiscard]] virtual std::vector<std::pair<std::string, std::string>> held() = 0;
  /// Other servers have these jobs now.
  virtual void lost(const std::vector<std::string>& ids) = 0;
  /// The job must end; repeated until it has.
  virtual void cancelled(const std::string& id) = 0;
  /// Returns the current state of the running jobs.
  [[nodiscard]] virtual std::vector<LiveJob> live() = 0;
};

struct FleetLimits {
  QueueLimits queue;    ///< limits of all servers together, except workers
  double keep_s = 0.0;  ///< retention time of results
  std::int64_t answer_bytes = 0;
  bool keeps_requests = false;  ///< keeps those of jobs with a result, while there is memory
  double lease_s = 0.0;
  int job_starts = 2;
};

/// Thread-safe.
class FleetStore {
 public:
  /// Connects by itself, with retries. `server` is this server's name as shown to users.
  FleetStore(std::string uri, std::string server, const FleetLimits& limits, const Log& log,
             FleetTaker& taker);

  void add(std::shared_ptr<FleetJob> job, CompletionCallback settled);
  /// Writes nothing if the token is no longer valid. Retried until it is written: then `settled` is called.
  void finish(StoredResult result, const std::string& token, CompletionCallback settled);
  /// The job waits again, for any server.
  void release(const std::string& id, const std::string& token);
  /// Gives a waiting job this result, and asks the server of a running one to end it.
  void cancel(StoredResult if_waiting, CompletionCallback settled);
  void forget(const std::string& id, CompletionCallback settled);

  /// Opens an array whose elements follow, until it is sealed or dropped; refused like a job. If `job.id` is
  /// not its own id, elements are ignored.
  void open_array(std::shared_ptr<FleetJob> job, CompletionCallback settled);
  void add_element(std::shared_ptr<FleetJob> job, StoredElement element, CompletionCallback settled);
  /// Admits the array, with its elements, digest and info in `whole`: any server may take it.
  void seal_array(std::shared_ptr<FleetJob> job, StoredResult whole, CompletionCallback settled);
  void drop_array(std::shared_ptr<FleetJob> job);
  /// Both are retried until they are written; nothing is if the token is no longer valid.
  void claim_elements(std::shared_ptr<ElementClaim> claim, CompletionCallback settled);
  void answer_element(ElementAnswer answer, const std::string& token, CompletionCallback settled);

  /// There may be jobs to take.
  void look_for_jobs();
  /// Takes no more jobs, and completes the pending writes.
  void close() { changes_.close(); }
  [[nodiscard]] Expected<void> health() const { return changes_.health(); }
  [[nodiscard]] StoreUsage usage() const;
  [[nodiscard]] bool is_settled() const { return changes_.is_settled(); }

 private:
  enum class Kind { add, finish, release, cancel, forget, open, add_element, seal, drop, claim, answer };
  struct Change {
    Kind kind = Kind::add;
    std::shared_ptr<FleetJob> job = {};
    StoredResult result = {};
    std::string token = {};
    StoredElement element = {};
    ElementAnswer answer = {};
    std::shared_ptr<ElementClaim> claim = {};
    CompletionCallback settled = {};
    [[nodiscard]] static bool is_change() { return true; }
    [[nodiscard]] bool is_patient() const { return is_lasting(); }
    [[nodiscard]] bool is_lasting() const {
      return kind == Kind::finish || kind == Kind::release || kind == Kind::claim || kind == Kind::answer;
    }
    // Adds a job or a part of one, within the bounds of all servers.
    [[nodiscard]] bool adds() const { return names_job() || kind == Kind::add_element; }
    [[nodiscard]] bool names_job() const {
      return kind == Kind::add || kind == Kind::open || kind == Kind::seal;
    }
    // Other servers act on it.
    [[nodiscard]] bool is_news() const {
      return kind != Kind::open && kind != Kind::add_element && kind != Kind::drop && kind != Kind::claim;
    }
  };
  // A client's jobs of one priority. Suspects have lines of their own: jobs during which a server died, and
  // that may start again. A server runs one suspect at a time, so that the next death of a server counts for
  // one only.
  struct Line {
    std::string client;
    std::size_t priority = 0;
    bool suspect = false;
    std::int64_t waiting = 0, running = 0, bytes = 0, turn = 0, drafts = 0;
  };
  using Lines = std::vector<Line>;
  struct Due {
    bool second = false, garbage_collector = false;
  };

  [[nodiscard]] Expected<void> write(std::vector<Change>& changes);
  [[nodiscard]] Expected<void> write_once(std::vector<Change>& changes, const Due& due);
  [[nodiscard]] Expected<void> connect();
  [[nodiscard]] Expected<void> renew();
  [[nodiscard]] Expected<Lines> lines();
  [[nodiscard]] Expected<void> add_all(std::vector<Change>& changes, Lines& lines);
  [[nodiscard]] Expected<std::vector<TakenJob>> take(const Lines& lines, FleetTaker::Room room);
  [[nodiscard]] Expected<void> count_elements(std::vector<TakenJob>& taken);
  [[nodiscard]] Expected<void> clean();
  class Adding;

  const std::string uri_, server_, instance_;
  const FleetLimits limits_;
  const Log& log_;
  FleetTaker& taker_;
  std::optional<Postgres> database_;  // used by the writer's thread, like all down to bytes_
  std::chrono::steady_clock::time_point connected_ = {}, second_ = {}, garbage_collector_ = {};
  StarvationLimit starvation_limit_;
  std::int64_t takes_ = 0;
  std::map<std::string, std::string> drafts_;  // tokens of arrays that are being received, by id
  std::atomic<std::int64_t> bytes_ = 0;
  std::atomic<bool> looks_ = true;
  GroupWriter<Change> changes_;
};

}  // namespace marble::server
