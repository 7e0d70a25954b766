// A thread that writes what a store is asked for. What has come while it wrote the last time goes together
// into one transaction, so that many changes share one wait for the disk (group commit).
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

/// Told once a change is on disk, or why it is not. On the writer's thread, without a lock.
using Settled = std::function<void(const Expected<void>&)>;

/// How a store does.
struct StoreUsage {
  bool written = true;  ///< what was tried last
  /// Transactions, what was asked for in them, and seconds they took; of those that were made.
  std::int64_t commits = 0, changes = 0;
  double commit_s = 0.0;
  std::int64_t bytes = 0;  ///< that it takes on disk
};

/// A `Change` has `settled`, which is told once; says whether it `is_change()`, else somebody just waits for
/// those before it; whether it `is_lasting()`: what could not be written is tried again until it is; and
/// whether it `is_patient()`: it is told only once it was written.
/// Thread-safe. Changes are written in the order in which they were asked for.
template <class Change>
class GroupWriter {
 public:
  /// One transaction: all of it or nothing, and why not.
  using Write = std::function<Expected<void>(std::vector<Change>&)>;

  /// With a period it writes that often where nothing is asked for, too.
  GroupWriter(const Log& log, Write write,
              std::optional<std::chrono::steady_clock::duration> period = std::nullopt)
      : log_(log), write_(std::move(write)), period_(period), thread_([this] { work(); }) {}
  ~GroupWriter() { close(); }
  GroupWriter(const GroupWriter&) = delete;
  GroupWriter& operator=(const GroupWriter&) = delete;

  /// Writes what it was asked for, or as much of it as can be written now, and nothing from then on.
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
  /// Writes now, whether something is asked for or not.
  void wake() ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      woken_ = true;
    }
    wake_.notify_all();
  }

  /// Why nothing could be written the last time, if so.
  [[nodiscard]] Expected<void> health() const ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    return health_;
  }
  /// All but the bytes.
  [[nodiscard]] StoreUsage usage() const ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    StoreUsage usage = usage_;
    usage.written = health_.has_value();
    return usage;
  }
  /// Whether nothing is under way.
  [[nodiscard]] bool is_settled() const ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    return changes_.empty() && !writing_;
  }

 private:
  static constexpr std::chrono::seconds kAgain{
      1};  // after this long what could not be written is tried again

  // What is to be written next, after a while if the last time failed: then nothing new will do too, to see
  // whether it still fails. False at the end.
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

  // Who asked is told, once. Nothing is tried again at the end.
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
      if (const Settled settled = std::exchange(change.settled, nullptr)) settled(made);
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
  StoreUsage usage_ ABSL_GUARDED_BY(mutex_);  // its counts
  std::thread thread_;
};

}  // namespace marble::server
