// A thread that writes the changes of a store. Changes that arrive during one write go together into the
// next transaction, so that many changes share one wait for the disk (group commit).
#pragma once

#include <algorithm>
#include <chrono>
#include <exception>
#include <functional>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "base/refusal.h"
#include "log/log.h"
#include "mutex.h"

namespace marble::server {

/// Called once a change is on disk, or with the error. On the writer's thread, without a lock.
using CompletionCallback = std::function<void(const Expected<void>&)>;

/// State of a store.
struct StoreUsage {
  bool written = true;  ///< whether the last attempt succeeded
  /// Transactions, changes in them, and seconds they took; successful ones only.
  std::int64_t commits = 0, changes = 0;
  double commit_s = 0.0;
  std::int64_t bytes = 0;  ///< on disk
};

/// A `Change` has `settled`, which is called once; `is_change()`, else it only waits for the changes before
/// it; `is_lasting()`: it is retried until it is written; and `is_patient()`: `settled` is called only once
/// it is written. Thread-safe. Changes are written in the order of the calls.
template <class Change>
class GroupWriter {
 public:
  /// One transaction: all of it or nothing, with the error.
  using Write = std::function<Expected<void>(std::vector<Change>&)>;

  /// With a period, it writes at least that often, even without changes.
  GroupWriter(const Log& log, Write write,
              std::optional<std::chrono::steady_clock::duration> period = std::nullopt)
      : log_(log), write_(std::move(write)), period_(period), thread_([this] { work(); }) {}
  ~GroupWriter() { close(); }
  GroupWriter(const GroupWriter&) = delete;
  GroupWriter& operator=(const GroupWriter&) = delete;

  /// Writes the pending changes, or as many as can be written now, and nothing from then on.
  void close() ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      closing_ = true;
    }
    wake_.notify_all();
    if (thread_.joinable()) thread_.join();
  }

  void ask(Change change) ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      if (!closed_) {
        changes_.push_back(std::move(change));
        wake_.notify_all();
        return;
      }
    }
    if (change.settled) change.settled(unexpected(draining()));
  }
  /// Writes now, with or without changes.
  void wake() ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      woken_ = true;
    }
    wake_.notify_all();
  }

  /// The error of the last write, if it failed.
  [[nodiscard]] Expected<void> health() const ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    return health_;
  }
  /// Everything except the bytes.
  [[nodiscard]] StoreUsage usage() const ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    StoreUsage usage = usage_;
    usage.written = health_.has_value();
    return usage;
  }
  /// True if nothing is in progress.
  [[nodiscard]] bool is_settled() const ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    return changes_.empty() && !writing_;
  }

 private:
  static constexpr std::chrono::seconds kAgain{1};  // time until a failed write is retried

  // Returns the next changes to write, after a delay if the last write failed: then even an empty write is
  // tried, to see whether it still fails. False at the end.
  [[nodiscard]] bool take(std::vector<Change>& changes) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (!health_) {
      while (!closing_ && wake_.wait_until(mutex_, now + kAgain) == std::cv_status::no_timeout) {
      }
    } else if (period_) {
      while (changes_.empty() && !closing_ && !woken_ &&
             wake_.wait_until(mutex_, now + *period_) == std::cv_status::no_timeout) {
      }
    } else {
      while (changes_.empty() && !closing_ && !woken_) wake_.wait(mutex_);
    }
    closed_ = changes_.empty() && closing_;
    if (closed_) return false;
    woken_ = false;
    changes.swap(changes_);
    writing_ = true;
    return true;
  }

  // No exception ends the thread, and with it the server.
  [[nodiscard]] Expected<void> attempt(std::vector<Change>& changes) const {
    try {
      return write_(changes);
    } catch (const std::exception& error) {
      return unexpected(failure(ErrorCode::unavailable, "state", "", error.what()));
    }
  }

  void work() ABSL_LOCKS_EXCLUDED(mutex_) {
    std::vector<Change> changes;
    while (take(changes)) {
      const auto begin = std::chrono::steady_clock::now();
      const Expected<void> made = attempt(changes);
      if (made && !changes.empty())
        count(changes, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
      settle(changes, made);
      changes.clear();
    }
  }

  void count(const std::vector<Change>& changes, double seconds) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    ++usage_.commits;
    usage_.changes += std::ranges::count_if(changes, [](const Change& change) { return change.is_change(); });
    usage_.commit_s += seconds;
  }

  // Notifies each caller once. Nothing is retried at the end.
  void settle(std::vector<Change>& changes, const Expected<void>& made) ABSL_LOCKS_EXCLUDED(mutex_) {
    bool was_well = true;
    {
      const MutexLock lock(mutex_);
      was_well = health_.has_value();
      health_ = made;
    }
    if (!made && was_well)
      log_.error(Component::server, "state_not_written",
                 {{"state", made.error().value}, {"reason", made.error().bound}});
    if (made && !was_well) log_.info(Component::server, "state_written_again", {});
    for (Change& change : changes) {
      if (!made && change.is_patient()) continue;
      if (const CompletionCallback settled = std::exchange(change.settled, nullptr)) settled(made);
    }
    const MutexLock lock(mutex_);
    if (!made && !closing_) {
      std::erase_if(changes, [](const Change& change) { return !change.is_lasting(); });
      changes_.insert(changes_.begin(), std::make_move_iterator(changes.begin()),
                      std::make_move_iterator(changes.end()));
    }
    writing_ = false;
  }

  const Log& log_;
  const Write write_;
  const std::optional<std::chrono::steady_clock::duration> period_;
  mutable Mutex mutex_;
  Condition wake_;
  std::vector<Change> changes_ ABSL_GUARDED_BY(mutex_);
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool woken_ ABSL_GUARDED_BY(mutex_) = false;
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  Expected<void> health_ ABSL_GUARDED_BY(mutex_);
  StoreUsage usage_ ABSL_GUARDED_BY(mutex_);  // only its counts
  std::thread thread_;
};

}  // namespace marble::server
