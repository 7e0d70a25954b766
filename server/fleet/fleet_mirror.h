// What this server knows of the jobs in the store that several share: a record of each on its board, as if it
// were its own, so that lists, watchers and the page need not know where a job runs.
//
// One thread reads: what has changed, whenever servers say so and once a second besides; what somebody asks
// for; and, while somebody watches, what running jobs tell.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "base/descriptor.h"
#include "fleet/fleet_schema.h"
#include "service/service_parts.h"
#include "store/group_writer.h"
#include "store/submissions.h"

namespace marble::server {

/// What the mirror asks of, and tells, the jobs that run here.
class FleetOwner {
 public:
  virtual ~FleetOwner() = default;
  [[nodiscard]] virtual bool has(const std::string& id) = 0;
  /// Calls it while the job does not run here and does not begin to; whether it was so.
  virtual bool unless_here(const std::string& id, const std::function<void()>& then) = 0;
  /// Some job waits.
  virtual void jobs_wait() = 0;
};

/// Thread-safe.
class FleetMirror {
 public:
  FleetMirror(const ServiceParts& parts, FleetOwner& owner);
  void start() {
    thread_ = std::thread([this] { run(); });
  }
  ~FleetMirror() { close(); }
  FleetMirror(const FleetMirror&) = delete;
  FleetMirror& operator=(const FleetMirror&) = delete;

  /// Until the store was read once, or for `patience`.
  void wait(std::chrono::milliseconds patience) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Submissions::look(). At once where the store cannot be reached.
  void look(const std::string& id, Settled then) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Gives the answer to the results, when it can.
  void fetch(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Submissions::recall().
  void recall(const std::string& id, std::function<void(Expected<AskedAndAnswered>)> then)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// What is known here of a job is not what the store knows.
  void read_anew(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Whether nobody waits for it.
  [[nodiscard]] bool is_settled() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Answers what it was asked for as it can, and nothing from then on.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Look {
    std::string id;
    Settled then;
  };
  struct Recall {
    std::string id;
    std::function<void(Expected<AskedAndAnswered>)> then;
  };
  struct Asked {
    std::vector<Look> looks;
    std::vector<Recall> recalls;
    std::vector<std::string> fetches;
    std::vector<std::string> anew;
  };
  // Of jobs that are not gone; the thread's own.
  struct Known {
    FleetState state = FleetState::waiting;
    std::int64_t number = 0;
    std::size_t priority = 0;
    std::string server;
    std::int64_t upto = -1;  // of its rows there, those before this were seen
    bool is_whole = false;   // its trace is there too, to its end
  };
  // Jobs that wait, in order: what is asked for a job's place.
  struct Waiting {
    Mutex mutex;
    std::vector<std::pair<std::size_t, std::int64_t>> line ABSL_GUARDED_BY(mutex);
  };

  void run() ABSL_LOCKS_EXCLUDED(mutex_);
  void ring() const;
  [[nodiscard]] Asked take() ABSL_LOCKS_EXCLUDED(mutex_);
  void tell(const Look& look, const Expected<void>& looked) const;
  void set_well(const Expected<void>& done) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<void> attempt(const Asked& asked);
  [[nodiscard]] Expected<void> connect();
  [[nodiscard]] Expected<void> answer(const Asked& asked);
  [[nodiscard]] Expected<void> read_all();
  [[nodiscard]] Expected<void> read_changes();
  [[nodiscard]] Expected<void> read_whole(const std::string& id);
  [[nodiscard]] Expected<void> read_live();
  [[nodiscard]] Expected<void> read_answer(const std::string& id);
  [[nodiscard]] Expected<AskedAndAnswered> read_both(const std::string& id);
  void apply(const PgRows& rows, int row);
  void show(const std::string& id, Known& known, const PgRows& rows, int row, bool is_new);
  void forget(const std::string& id);
  void wait_in_line();

  const ServiceParts& parts_;
  FleetOwner& owner_;
  const Descriptor bell_;
  mutable Mutex mutex_;
  Condition well_again_;
  Asked asked_ ABSL_GUARDED_BY(mutex_);
  Expected<void> well_ ABSL_GUARDED_BY(mutex_) = unexpected(failure(ErrorCode::unavailable, "state",
                                                                    "is not connected yet"));
  bool working_ ABSL_GUARDED_BY(mutex_) = false;
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  const std::shared_ptr<Waiting> waiting_ = std::make_shared<Waiting>();
  std::optional<Postgres> database_;  // the thread's own, as all from here
  std::string horizon_;               // transactions from this one on may not have been seen
  std::unordered_map<std::string, Known> known_;
  std::vector<std::string> wanted_;  // answers that could not be fetched yet
  std::thread thread_;
};

}  // namespace marble::server
