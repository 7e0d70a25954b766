// What of a batch is to be sent, and what waits for its answer: on one stream after the other, where servers
// are lost.
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

/// Thread-safe: one thread puts, each stream has one that sends, and one takes answers. Problems have numbers
/// of their own on the wire, as a caller's tags may be the same.
class BatchQueue {
 public:
  using Request = std::shared_ptr<const v1::SolveBatchRequest>;
  using Clock = std::chrono::steady_clock;

  /// One problem more, once the last one was sent. False: no more are wanted.
  [[nodiscard]] bool put(std::int64_t tag, v1::SolveBatchRequest request) ABSL_LOCKS_EXCLUDED(mutex_);
  /// One that cannot be sent.
  void refuse(std::int64_t tag, Error error) ABSL_LOCKS_EXCLUDED(mutex_);
  /// There are no more.
  void exhaust() ABSL_LOCKS_EXCLUDED(mutex_);

  /// The number of the next stream, which sends all that is not answered, before anything new.
  [[nodiscard]] int begin_stream() ABSL_LOCKS_EXCLUDED(mutex_);
  /// That stream has ended.
  void end_stream() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Waits for what the stream sends next; null at its end, or once all is answered.
  [[nodiscard]] Request next(int stream) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Ends all waiting.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool is_closed() ABSL_LOCKS_EXCLUDED(mutex_);

  /// The tag of a problem, which has its answer now; nothing if it has one already.
  [[nodiscard]] std::optional<std::int64_t> answered(std::int64_t number) ABSL_LOCKS_EXCLUDED(mutex_);
  /// The problem is sent again, on the same stream not before this time.
  void send_again(std::int64_t number, Clock::time_point when) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool done() ABSL_LOCKS_EXCLUDED(mutex_);
  /// What could not be sent since the last call.
  [[nodiscard]] std::vector<std::pair<std::int64_t, Error>> refused() ABSL_LOCKS_EXCLUDED(mutex_);
  /// The tags of all that has no answer, at the end.
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
  std::int64_t sent_ ABSL_GUARDED_BY(mutex_) = 0;  // of the numbers, at least once
  int stream_ ABSL_GUARDED_BY(mutex_) = 0;
  bool is_open_ ABSL_GUARDED_BY(mutex_) = false;  // the stream
  bool exhausted_ ABSL_GUARDED_BY(mutex_) = false;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace marble::client
