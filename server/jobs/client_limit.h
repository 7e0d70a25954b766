// Limits the number of concurrent uses of something, in total and per client.
#pragma once

#include <map>
#include <string>
#include <utility>

#include "marble/error.h"
#include "mutex.h"

namespace marble::server {

/// Thread-safe.
class ClientLimit {
 public:
  /// `setting` names the server's limit `most`, and what it counts; the limit of one client is
  /// client_`setting`.
  ClientLimit(std::string setting, int most) : setting_(std::move(setting)), most_(most) {}

  /// Each successful enter() needs its leave(). Errors: resource_exhausted, for the server's limit or the
  /// client's, `most_own`.
  [[nodiscard]] Expected<void> enter(const std::string& client, int most_own) ABSL_LOCKS_EXCLUDED(mutex_) {
    const auto full = [](std::string field, std::string bound) {
      return unexpected(failure(ErrorCode::resource_exhausted, std::move(field), std::move(bound)));
    };
    const MutexLock lock(mutex_);
    if (open_ >= most_)
      return full(setting_, "at most " + std::to_string(most_) + " are allowed at once; try again later");
    const auto own = of_client_.find(client);
    if (own != of_client_.end() && own->second >= most_own) {
      return full("client_" + setting_, "the client \"" + client + "\" may have at most " +
                                            std::to_string(most_own) + " at once; try again later");
    }
    ++open_;
    ++of_client_[client];
    return {};
  }
  void leave(const std::string& client) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    --open_;
    if (--of_client_[client] == 0) of_client_.erase(client);
  }
  [[nodiscard]] int open() const ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    return open_;
  }
  [[nodiscard]] int most() const { return most_; }

 private:
  const std::string setting_;
  const int most_;
  mutable Mutex mutex_;
  int open_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, int> of_client_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
