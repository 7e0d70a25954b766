// Limits requests of the HTTP port that keep a thread for long or need much memory.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "marble/error.h"
#include "mutex.h"

namespace marble::server::http {

/// Thread-safe.
class Semaphore {
 public:
  /// `threads` that long requests may keep, fewer than all; `bytes` of memory.
  Semaphore(int threads, std::int64_t bytes) : threads_(threads), bytes_(bytes) {}
  Semaphore(const Semaphore&) = delete;
  Semaphore& operator=(const Semaphore&) = delete;

  /// What one request holds; released at its end.
  class Permit {
   public:
    Permit(Permit&& other) noexcept
        : all_(std::exchange(other.all_, nullptr)),
          threads_(other.threads_),
          bytes_(other.bytes_),
          client_(std::move(other.client_)) {}
    Permit& operator=(Permit&&) = delete;
    ~Permit() {
      if (all_ != nullptr) all_->leave(*this);
    }
    /// Holds this number of bytes from now on. Errors: resource_exhausted; it then keeps the number it had.
    [[nodiscard]] Expected<void> resize(std::int64_t bytes) {
      MARBLE_RETURN_IF_ERROR(all_->take(client_, bytes_, bytes));
      bytes_ = bytes;
      return {};
    }

   private:
    friend class Semaphore;
    Permit(Semaphore& all, int threads, std::int64_t bytes, std::string client)
        : all_(&all), threads_(threads), bytes_(bytes), client_(std::move(client)) {}

    Semaphore* all_;
    int threads_;
    std::int64_t bytes_;
    std::string client_;
  };

  /// Reserves a thread for the whole request. Errors: resource_exhausted.
  [[nodiscard]] Expected<Permit> stay() ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (staying_ >= threads_) {
      return unexpected(failure(ErrorCode::resource_exhausted, "http_connections",
                                "leaves room for " + std::to_string(threads_) + " requests that last"));
    }
    ++staying_;
    return Permit(*this, 1, 0, "");
  }
  /// Reserves bytes for a client, which may have at most half of the total. The only request of a client may
  /// exceed this half, and the only request of all clients the total. Errors: resource_exhausted.
  [[nodiscard]] Expected<Permit> hold(const std::string& client, std::int64_t bytes)
      ABSL_LOCKS_EXCLUDED(mutex_) {
    MARBLE_RETURN_IF_ERROR(take(client, 0, bytes));
    return Permit(*this, 0, bytes, client);
  }

 private:
  // `bytes` instead of `had`.
  [[nodiscard]] Expected<void> take(const std::string& client, std::int64_t had, std::int64_t bytes)
      ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    const auto own = held_by_.find(client);
    const std::int64_t of_client = own == held_by_.end() ? 0 : own->second - had;
    const std::int64_t of_all = held_ - had;
    if (bytes > had && of_all > 0 && bytes > bytes_ - of_all) {
      return unexpected(failure(ErrorCode::resource_exhausted, "transport_bytes",
                                "is taken by other requests; come back in a moment"));
    }
    if (bytes > had && of_client > 0 && bytes > bytes_ / 2 - of_client) {
      return unexpected(
          failure(ErrorCode::resource_exhausted, "transport_bytes",
                  "is taken to its half by other requests of this client; come back in a moment"));
    }
    held_ = of_all + bytes;
    held_by_[client] = of_client + bytes;
    return {};
  }
  void leave(const Permit& place) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    staying_ -= place.threads_;
    held_ -= place.bytes_;
    const auto own = held_by_.find(place.client_);
    if (own != held_by_.end() && (own->second -= place.bytes_) == 0) held_by_.erase(own);
  }

  const int threads_;
  const std::int64_t bytes_;
  Mutex mutex_;
  int staying_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t held_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, std::int64_t> held_by_ ABSL_GUARDED_BY(mutex_);  // key: client
};

}  // namespace marble::server::http
