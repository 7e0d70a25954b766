// One array in progress: which elements wait, run and have ended, and who waits for their results.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "store/array_source.h"
#include "store/job_store.h"
#include "submissions/array_setup.h"
#include "submissions/one_suspect.h"

namespace marble::server {

/// Returns the reply to a request for the single result of an array.
[[nodiscard]] ResultStore::Result no_single_answer(const std::string& id);

/// An element without a result.
struct OpenElement {
  std::int64_t index = 0;
  std::int64_t lost = 0;  ///< starts during which the server died
};

/// The state of an array when it is accepted or recovered.
struct ArrayStart {
  std::shared_ptr<JobRecord> record = {};
  std::shared_ptr<const ArraySetup> setup = {};  ///< null for an array that is over
  std::shared_ptr<Scheduler::Place> place = {};  ///< likewise
  ArrayCounts counts = {};
  std::int64_t last_sequence = 0, answer_bytes = 0;
  std::vector<OpenElement> open = {};  ///< without those that a shared store still has to give
  std::optional<Error> end = {};       ///< why it ends, or has ended, before its last element
  bool is_over = false;
  /// Of a shared store: its elements, and who is notified once, when the array has ended or when this server
  /// has nothing more to do with it.
  std::shared_ptr<ElementStore> store = {};
  std::function<void()> left = {};
};

/// Elements enter the scheduler a few at a time, as others of them end, so an array of any length leaves the
/// queue to other jobs and takes turns with them. Each element gets one result; a result is reported once it
/// is kept, with a number in that order. Thread-safe.
class Array final : public ArraySource, public RoomWaiter, public std::enable_shared_from_this<Array> {
 public:
  Array(const ServiceParts& parts, ElementStore& store, OneSuspect& suspects, ArrayStart start);

  /// Called once it is on the board.
  void start() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] const JobDescription& description() const { return record_->description(); }

  /// Ends the array: running elements return their best iterate, waiting ones get no result.
  void cancel() ABSL_LOCKS_EXCLUDED(mutex_);
  /// The array and its results are dropped.
  void forgotten() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Another server continues it: what runs here ends, and nothing of it is kept.
  void abandon() ABSL_LOCKS_EXCLUDED(mutex_);
  // From the scheduler, or from another suspect: there may be capacity.
  void room() override { feed(); }

  [[nodiscard]] Expected<News> news_after(std::int64_t sequence, std::int64_t most_bytes) override
      ABSL_LOCKS_EXCLUDED(mutex_);
  void listen(const std::weak_ptr<ArrayListener>& listener) override ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::int64_t elements() const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::int64_t answer_bytes() const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Run;
  class Keeper;
  enum class Stage { open, ending, over };

  void feed() ABSL_LOCKS_EXCLUDED(mutex_);
  void admit_waiting() ABSL_LOCKS_EXCLUDED(mutex_);
  void claim() ABSL_LOCKS_EXCLUDED(mutex_);
  void claimed(bool suspect, const Expected<std::vector<ClaimedElement>>& elements)
      ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool waits() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void stop(const std::optional<Error>& reason) ABSL_LOCKS_EXCLUDED(mutex_);
  void release() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::shared_ptr<Run> next() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::shared_ptr<Job> job_of(const std::shared_ptr<Run>& run);
  [[nodiscard]] Expected<Solution> solve(Run& run, const std::weak_ptr<Job>& job,
                                         const SolveControls& controls);
  void put_back(const Run& run) ABSL_LOCKS_EXCLUDED(mutex_);
  void ended(const Run& run, const Outcome& outcome) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] ElementAnswer answer_of(const Run& run, const Outcome& outcome) const;
  [[nodiscard]] ElementAnswer error_of(std::int64_t index, const Error& error) const;
  void keep(ElementAnswer answer);
  void kept(const ElementAnswer& answer) ABSL_LOCKS_EXCLUDED(mutex_);
  void set_aside_lost() ABSL_LOCKS_EXCLUDED(mutex_);
  void set_aside(const std::vector<OpenElement>& elements);
  [[nodiscard]] bool is_lost(std::int64_t lost) const;
  void end_if_over() ABSL_LOCKS_EXCLUDED(mutex_);
  void end(const std::optional<Error>& reason) ABSL_LOCKS_EXCLUDED(mutex_);
  void report() ABSL_LOCKS_EXCLUDED(mutex_);

  const ServiceParts& parts_;
  const std::shared_ptr<ElementStore> own_store_;  // set if it is shared
  ElementStore& store_;
  const std::function<void()> left_;
  OneSuspect& one_suspect_;
  const std::shared_ptr<JobRecord> record_;
  std::shared_ptr<const ArraySetup> setup_;  // set until the last element has ended
  const std::size_t most_running_;
  mutable Mutex mutex_;
  std::shared_ptr<Scheduler::Place> place_ ABSL_GUARDED_BY(mutex_);
  std::deque<OpenElement> waiting_ ABSL_GUARDED_BY(mutex_);
  std::deque<OpenElement> suspects_ ABSL_GUARDED_BY(mutex_);  // those that ran when a server was killed
  std::map<std::int64_t, std::shared_ptr<Job>> running_ ABSL_GUARDED_BY(mutex_);  // or in the queue
  int feed_calls_ ABSL_GUARDED_BY(mutex_) = 0;  // calls of feed() that are not served yet
  int unsettled_ ABSL_GUARDED_BY(mutex_) = 0;   // results on their way to the store
  ArrayCounts counts_ ABSL_GUARDED_BY(mutex_);
  std::int64_t last_sequence_ ABSL_GUARDED_BY(mutex_);
  std::int64_t answer_bytes_ ABSL_GUARDED_BY(mutex_);
  std::deque<ElementAnswer> newest_ ABSL_GUARDED_BY(mutex_);  // results, for readers that have all others
  std::int64_t newest_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  bool more_ ABSL_GUARDED_BY(mutex_);                     // a shared store may have more elements to claim
  bool more_suspects_ ABSL_GUARDED_BY(mutex_);            // likewise
  std::optional<double> mean_s_ ABSL_GUARDED_BY(mutex_);  // run time of recent elements
  bool claiming_ ABSL_GUARDED_BY(mutex_) = false;
  bool abandoned_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<Error> end_ ABSL_GUARDED_BY(mutex_);
  Stage stage_ ABSL_GUARDED_BY(mutex_);
  bool is_gone_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::weak_ptr<ArrayListener>> listeners_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
