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
    explicit Token(LiveCalls& calls) : calls_(calls), counted_(calls.begin()) {}
    ~Token() {
      if (counted_) calls_.end();
    }
    Token(const Token&) = delete;
    Token& operator=(const Token&) = delete;

   private:
    LiveCalls& calls_;
    const bool counted_;
  };

  /// Waits until those of now have ended, or for `limit`. Nobody waits for later ones: whoever asks again and
  /// again could hold up a stop.
  void wait_for_last(std::chrono::steady_clock::duration limit) ABSL_LOCKS_EXCLUDED(mutex_) {
    const auto end = std::chrono::steady_clock::now() + limit;
    const MutexLock lock(mutex_);
    last_known_ = true;
    while (count_ > 0 && none_.wait_until(mutex_, end) == std::cv_status::no_timeout) {
    }
  }

 private:
  [[nodiscard]] bool begin() ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (!last_known_) ++count_;
    return !last_known_;
  }
  void end() ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (--count_ == 0) none_.notify_all();
  }

  Mutex mutex_;
  Condition none_;
  int count_ ABSL_GUARDED_BY(mutex_) = 0;
  bool last_known_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace marble::server
