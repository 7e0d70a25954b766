// This server's copy of the jobs in a shared store: a record of each on its board, like those of its own
// jobs, so that lists, watchers and the page do not depend on where a job runs.
//
// One thread reads: changes, whenever servers announce them and once a second besides; what is requested;
// and, while there are watchers, the progress of running jobs.
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
#include "fleet/fleet_readers.h"
#include "fleet/fleet_schema.h"
#include "service/service_parts.h"
#include "store/group_writer.h"
#include "store/submissions.h"

namespace marble::server {

/// The jobs that run on this server, as the mirror queries and notifies them.
class FleetOwner {
 public:
  virtual ~FleetOwner() = default;
  [[nodiscard]] virtual bool has(const std::string& id) = 0;
  /// Calls `then` if the job does not run on this server, and prevents it from starting meanwhile; returns
  /// whether it did.
  virtual bool unless_here(const std::string& id, const std::function<void()>& then) = 0;
  /// At least one job waits.
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

  /// Waits until the store was read once, or for `patience`.
  void wait(std::chrono::milliseconds patience) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Submissions::look(). Calls back at once if the store cannot be reached.
  void look(const std::string& id, CompletionCallback then) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Passes the result to the result store, as soon as it can.
  void fetch(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Submissions::fetch_pair().
  void fetch_pair(const std::string& id, std::function<void(Expected<AskedAndAnswered>)> then)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Submissions::find_array().
  void find_array(const std::string& id, FleetReaders::Find then) ABSL_LOCKS_EXCLUDED(mutex_);
  /// This server's state of the job differs from the store's: reads it again.
  void read_anew(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  /// True if no caller waits for it.
  [[nodiscard]] bool is_settled() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Completes the pending requests as far as it can, and none from then on.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Look {
    std::string id;
    CompletionCallback then;
  };
  struct PairFetch {
    std::string id;
    std::function<void(Expected<AskedAndAnswered>)> then;
  };
  struct Asked {
    std::vector<Look> looks;
    std::vector<PairFetch> pair_fetches;
    std::vector<std::string> fetches;
    std::vector<std::string> anew;
  };
  // State of the jobs that are not gone; used by the mirror's thread only.
  struct Known {
    FleetState state = FleetState::waiting;
    std::int64_t number = 0;
    std::size_t priority = 0;
    std::string server;
    std::int64_t upto = -1;  // the rows before this one were read
    bool is_whole = false;   // its trace was read too, to its end
  };
  // Waiting jobs in order, for queries of a job's place.
  struct Waiting {
    Mutex mutex;
    std::vector<std::pair<std::size_t, std::int64_t>> line ABSL_GUARDED_BY(mutex);
  };

  void run() ABSL_LOCKS_EXCLUDED(mutex_);
  void ring() const;
  [[nodiscard]] Asked take() ABSL_LOCKS_EXCLUDED(mutex_);
  void report(const Look& look, const Expected<void>& looked) const;
  void set_well(const Expected<void>& done) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<void> attempt(const Asked& asked, bool changed);
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
  FleetReaders readers_{[this] { ring(); }};
  std::optional<Postgres> database_;  // used by the mirror's thread only, like all that follow
  std::string horizon_;               // transactions from this one on may be unread
  std::unordered_map<std::string, Known> known_;
  std::vector<std::string> wanted_;  // results that could not be fetched yet
  std::thread thread_;
};

}  // namespace marble::server
