// Counts the calls that gRPC is not done with yet, so that a shutdown waits for answers on their way and for
// nothing else: gRPC's own waits for idle clients to close their connections.
#pragma once

#include <chrono>

#include "mutex.h"

namespace marble::server {

class LiveCalls {
 public:
  /// Held by a call for as long as it lives.
  class Token {
   public:
    explicit Token(LiveCalls& calls) : calls_(calls) { calls_.add(1); }
    ~Token() { calls_.add(-1); }
    Token(const Token&) = delete;
    Token& operator=(const Token&) = delete;

   private:
    LiveCalls& calls_;
  };

  /// Waits until there is none, or for `limit`.
  void wait_for_none(std::chrono::steady_clock::duration limit) ABSL_LOCKS_EXCLUDED(mutex_) {
    const auto end = std::chrono::steady_clock::now() + limit;
    const MutexLock lock(mutex_);
    while (count_ > 0 && none_.wait_until(mutex_, end) == std::cv_status::no_timeout) {
    }
  }

 private:
  void add(int change) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    count_ += change;
    if (count_ == 0) none_.notify_all();
  }

  Mutex mutex_;
  Condition none_;
  int count_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::server
