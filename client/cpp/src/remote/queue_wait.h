// Repeats a submission that a full server refuses.
#pragma once

#include <grpcpp/support/status.h>

#include <chrono>
#include <functional>
#include <limits>
#include <optional>
#include <stop_token>

#include "marble/error.h"

namespace marble::client {

/// The attempts of one submission. Only refusals for lack of space in the queue are repeated: other limits
/// would refuse the same request again.
class QueueWait {
 public:
  using Seconds = std::chrono::duration<double>;
  using Waiting = std::function<void(const Error& reason)>;

  /// `wait` counts from the first refusal; default: until the deadline, or 10 s if there is none. Errors: it
  /// is negative or not a number.
  [[nodiscard]] static Expected<QueueWait> create(std::optional<Seconds> wait,
                                                  std::optional<Seconds> deadline, std::stop_token stop,
                                                  const Waiting& waiting);

  /// Returns the time until the deadline, for the next attempt.
  [[nodiscard]] std::optional<Seconds> left() const;
  /// Waits as the refusal requests. Returns false if no further attempt should be made: waiting does not
  /// help, the time is over, or the caller cancelled.
  [[nodiscard]] bool pause(const grpc::Status& status);
  /// Returns the error of the last attempt.
  [[nodiscard]] Error error(const grpc::Status& status) const;

 private:
  using Clock = std::chrono::steady_clock;
  QueueWait(Seconds wait, std::optional<Seconds> deadline, std::stop_token stop, const Waiting& waiting)
      : wait_(wait), deadline_(deadline), stop_(std::move(stop)), waiting_(waiting) {}

  Seconds wait_;
  std::optional<Seconds> deadline_;
  std::stop_token stop_;
  const Waiting& waiting_;
  Clock::time_point begun_ = Clock::now();
  std::optional<Clock::time_point> refused_;  // first
};

}  // namespace marble::client
