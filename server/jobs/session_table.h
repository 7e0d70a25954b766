// Open sessions: their number, their clients, and the memory they use.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "base/quota.h"
#include "marble/error.h"
#include "mutex.h"

namespace marble::server {

struct SessionLimits {
  int sessions = 0;
  std::int64_t bytes = 0;  ///< memory of all sessions together
};

/// Thread-safe.
class SessionTable {
 public:
  /// One session's share of the limits, released at its end.
  class Place {
   public:
    Place(SessionTable& table, std::string client) : table_(table), client_(std::move(client)) {}
    ~Place() { table_.leave(client_, bytes_); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    /// Counts the session's memory. Errors: resource_exhausted.
    [[nodiscard]] Expected<void> take(std::int64_t bytes);

   private:
    SessionTable& table_;
    const std::string client_;
    std::int64_t bytes_ = 0;
  };

  explicit SessionTable(const SessionLimits& limits) : limits_(limits) {}

  /// Errors: resource_exhausted, for the server's limit or the client's.
  [[nodiscard]] Expected<std::unique_ptr<Place>> open(const std::string& client, const Quota& quota)
      ABSL_LOCKS_EXCLUDED(mutex_);

  struct Usage {
    int sessions = 0;
    std::int64_t bytes = 0, total = 0;  ///< total: number of sessions opened so far
  };
  [[nodiscard]] Usage usage() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Bytes that one more session may use.
  [[nodiscard]] std::int64_t room() const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void leave(const std::string& client, std::int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_);

  const SessionLimits limits_;
  mutable Mutex mutex_;
  Usage usage_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, int> of_client_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
