// Holds the problems of a batch that must be sent or wait for their result, over a sequence of streams if
// servers are lost.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "marble/error.h"
#include "marble/v1/service.pb.h"
#include "mutex.h"

namespace marble::client {

/// Is thread-safe: one thread puts, each stream has one thread that sends, and one thread receives results.
/// Problems have their own numbers on the wire, because the caller's tags may be equal.
class BatchQueue {
 public:
  using Request = std::shared_ptr<const v1::SolveBatchRequest>;
  using Clock = std::chrono::steady_clock;

  /// Adds a problem once the last one was sent. Returns false if no more are accepted.
  [[nodiscard]] bool put(std::int64_t tag, v1::SolveBatchRequest request) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Records a problem that cannot be sent.
  void refuse(std::int64_t tag, Error error) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Marks the end of the source.
  void exhaust() ABSL_LOCKS_EXCLUDED(mutex_);

  /// Returns the number of the next stream, which first sends everything without a result, then new problems.
  [[nodiscard]] int begin_stream() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Marks the end of that stream.
  void end_stream() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Waits for the stream's next request; null at its end, or once all have results.
  [[nodiscard]] Request next(int stream) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Ends all waits.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool is_closed() ABSL_LOCKS_EXCLUDED(mutex_);

  /// Marks a problem as done and returns its tag; nothing if it is done already.
  [[nodiscard]] std::optional<std::int64_t> answered(std::int64_t number) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Schedules a problem for another send, on the same stream not before this time.
  void send_again(std::int64_t number, Clock::time_point when) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool done() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the problems that could not be sent since the last call.
  [[nodiscard]] std::vector<std::pair<std::int64_t, Error>> refused() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the tags of all problems without a result, at the end.
  [[nodiscard]] std::vector<std::int64_t> unanswered() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Open {
    std::int64_t tag = 0;
    Request request;
  };

  Mutex mutex_;
  Condition changed_;
  std::map<std::int64_t, Open> open_ ABSL_GUARDED_BY(mutex_);  // by number
  std::deque<std::int64_t> due_ ABSL_GUARDED_BY(mutex_);       // numbers to be sent, the new one last
  std::multimap<Clock::time_point, std::int64_t> later_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::pair<std::int64_t, Error>> refused_ ABSL_GUARDED_BY(mutex_);
  std::int64_t numbers_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t sent_ ABSL_GUARDED_BY(mutex_) = 0;  // numbers sent at least once
  int stream_ ABSL_GUARDED_BY(mutex_) = 0;
  bool is_open_ ABSL_GUARDED_BY(mutex_) = false;  // whether the stream is open
  bool exhausted_ ABSL_GUARDED_BY(mutex_) = false;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace marble::client
