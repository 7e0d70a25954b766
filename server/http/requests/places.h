// What few requests of the HTTP port may have at a time: a thread for long, memory for much.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>

#include "marble/error.h"
#include "mutex.h"

namespace marble::server::http {

/// Thread-safe.
class Places {
 public:
  /// Threads, beyond which there must be others; bytes.
  Places(int threads, std::int64_t bytes) : threads_(threads), bytes_(bytes) {}
  Places(const Places&) = delete;
  Places& operator=(const Places&) = delete;

  /// What one request has; given back at its end.
  class Place {
   public:
    Place(Places& all, int threads, std::int64_t bytes) : all_(&all), threads_(threads), bytes_(bytes) {}
    Place(Place&& other) noexcept
        : all_(std::exchange(other.all_, nullptr)), threads_(other.threads_), bytes_(other.bytes_) {}
    Place& operator=(Place&&) = delete;
    ~Place() {
      if (all_ != nullptr) all_->leave(threads_, bytes_);
    }

   private:
    Places* all_;
    int threads_;
    std::int64_t bytes_;
  };

  /// A thread for as long as the request likes. Errors: resource_exhausted.
  [[nodiscard]] Expected<Place> stay() ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (staying_ >= threads_) {
      return unexpected(failure(ErrorCode::resource_exhausted, "http_connections",
                                "leaves room for " + std::to_string(threads_) + " requests that last"));
    }
    ++staying_;
    return Place(*this, 1, 0);
  }
  /// So many bytes; more than there are only where nobody else has any. Errors: resource_exhausted.
  [[nodiscard]] Expected<Place> hold(std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (held_ > 0 && bytes > bytes_ - held_) {
      return unexpected(failure(ErrorCode::resource_exhausted, "transport_bytes",
                                "is taken by other requests; come back in a moment"));
    }
    held_ += bytes;
    return Place(*this, 0, bytes);
  }

 private:
  void leave(int threads, std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    staying_ -= threads;
    held_ -= bytes;
  }

  const int threads_;
  const std::int64_t bytes_;
  Mutex mutex_;
  int staying_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t held_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::server::http
