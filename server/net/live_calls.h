// Counts the calls that gRPC is not done with yet, so that a shutdown waits for answers on their way and for
// nothing else: gRPC's own waits for idle clients to close their connections.
#pragma once

#include <chrono>
#include <vector>

#include "mutex.h"

namespace marble::server {

class LiveCalls {
 public:
  /// Held by a call for as long as it lives.
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

  /// A call whose client's message has not come yet.
  class Unread {
   public:
    /// Ends it: the server leaves.
    virtual void refuse() = 0;

   protected:
    ~Unread() = default;

   private:
    friend class LiveCalls;
    std::size_t place_ = 0;
  };

  /// Whether its message may be waited for: has_come() then says how that ended.
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

  /// From now on no message is waited for: refuses those who do, one by one.
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

  /// Waits until those of now have ended, or for `limit`. Nobody waits for later ones: whoever asks again and
  /// again could hold up a stop.
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
  int round_ ABSL_GUARDED_BY(mutex_) = 0;    // how often somebody has waited
  int earlier_ ABSL_GUARDED_BY(mutex_) = 0;  // of the calls, begun before that
  int later_ ABSL_GUARDED_BY(mutex_) = 0;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<Unread*> unread_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
