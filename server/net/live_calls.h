// Counts the calls that gRPC is not done with yet, so that a shutdown waits only for replies in transit:
// gRPC's own waits for idle clients to close their connections.
#pragma once

#include <chrono>
#include <vector>

#include "mutex.h"

namespace marble::server {

class LiveCalls {
 public:
  /// Held by a call while it lives.
  class Token {
   public:
    explicit Token(LiveCalls& calls) : calls_(calls), round_(calls.begin()) {}
    ~Token() { calls_.end(round_); }
    Token(const Token&) = delete;
    Token& operator=(const Token&) = delete;

   private:
    LiveCalls& calls_;
    const int round_;
  };

  /// A call whose client's message has not arrived yet.
  class Unread {
   public:
    /// Ends it because the server shuts down.
    virtual void refuse() = 0;

   protected:
    ~Unread() = default;

   private:
    friend class LiveCalls;
    std::size_t place_ = 0;
  };

  /// True if the call may wait for its message: has_come() then returns the outcome.
  [[nodiscard]] bool may_wait(Unread& call) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (closed_) return false;
    call.place_ = unread_.size();
    unread_.push_back(&call);
    return true;
  }
  /// False if it was refused meanwhile.
  [[nodiscard]] bool has_come(Unread& call) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (call.place_ >= unread_.size() || unread_[call.place_] != &call) return false;
    unread_[call.place_] = unread_.back();
    unread_[call.place_]->place_ = call.place_;
    unread_.pop_back();
    return true;
  }

  /// From now on no call waits for a message: refuses the waiting ones, one by one.
  void close() ABSL_LOCKS_EXCLUDED(mutex_) {
    const auto next = [this]() ABSL_LOCKS_EXCLUDED(mutex_) -> Unread* {
      const MutexLock lock(mutex_);
      closed_ = true;
      if (unread_.empty()) return nullptr;
      Unread* const last = unread_.back();
      unread_.pop_back();
      return last;
    };
    while (Unread* const call = next()) call->refuse();
  }

  /// Waits until the current calls have ended, or for `limit`. Ignores later calls: a client that keeps
  /// calling could otherwise delay a stop.
  void wait_for_last(std::chrono::steady_clock::duration limit) ABSL_LOCKS_EXCLUDED(mutex_) {
    const auto end = std::chrono::steady_clock::now() + limit;
    const MutexLock lock(mutex_);
    ++round_;
    earlier_ += later_;
    later_ = 0;
    while (earlier_ > 0 && none_.wait_until(mutex_, end) == std::cv_status::no_timeout) {
    }
  }

 private:
  [[nodiscard]] int begin() ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    ++later_;
    return round_;
  }
  void end(int round) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    int& count = round < round_ ? earlier_ : later_;
    if (--count == 0) none_.notify_all();
  }

  Mutex mutex_;
  Condition none_;
  int round_ ABSL_GUARDED_BY(mutex_) = 0;    // number of waits so far
  int earlier_ ABSL_GUARDED_BY(mutex_) = 0;  // calls that began before the last wait
  int later_ ABSL_GUARDED_BY(mutex_) = 0;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<Unread*> unread_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
