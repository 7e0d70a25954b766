// Of the jobs and elements of arrays that ran when a server was killed, one runs at a time, so that the next
// kill is the fault of at most one of them.
#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "jobs/scheduler.h"
#include "mutex.h"

namespace marble::server {

/// Thread-safe.
class OneSuspect {
 public:
  /// True if none runs; this one then runs until leave(). Else `waiter` is notified once when a retry may
  /// succeed.
  [[nodiscard]] bool enter(std::weak_ptr<RoomWaiter> waiter) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (!runs_) return runs_ = true;
    const auto same = [&](const auto& one) { return !one.owner_before(waiter) && !waiter.owner_before(one); };
    if (std::ranges::none_of(waiters_, same)) waiters_.push_back(std::move(waiter));
    return false;
  }
  /// True if one runs.
  [[nodiscard]] bool is_taken() ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    return runs_;
  }
  void leave() ABSL_LOCKS_EXCLUDED(mutex_) {
    std::vector<std::weak_ptr<RoomWaiter>> waiters;
    {
      const MutexLock lock(mutex_);
      runs_ = false;
      waiters.swap(waiters_);
    }
    for (const auto& weak : waiters) {
      if (const auto waiter = weak.lock()) waiter->room();
    }
  }

 private:
  Mutex mutex_;
  bool runs_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::weak_ptr<RoomWaiter>> waiters_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
