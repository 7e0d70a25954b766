// Number of results in the last minute, in buckets of one second. No threads, no clock.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>

namespace marble::server {

class LastMinute {
 public:
  using Time = std::chrono::steady_clock::time_point;
  struct Sum {
    std::int64_t answered = 0, solved = 0;  ///< solved: those among the answered
  };

  /// Adds one result. Time does not go back.
  void add(Time now, bool solved) {
    Bucket& bucket = buckets_[place_of(second_of(now))];
    if (bucket.second != second_of(now)) bucket = {second_of(now), {}};
    ++bucket.sum.answered;
    bucket.sum.solved += solved ? 1 : 0;
  }

  [[nodiscard]] Sum sum(Time now) const {
    Sum sum;
    for (const Bucket& bucket : buckets_) {
      if (bucket.second <= second_of(now) - kSeconds) continue;
      sum.answered += bucket.sum.answered;
      sum.solved += bucket.sum.solved;
    }
    return sum;
  }

 private:
  static constexpr std::int64_t kSeconds = 60;
  struct Bucket {
    std::int64_t second = -kSeconds;
    Sum sum;
  };
  static std::int64_t second_of(Time time) {
    return std::chrono::duration_cast<std::chrono::seconds>(time.time_since_epoch()).count();
  }
  static std::size_t place_of(std::int64_t second) { return static_cast<std::size_t>(second % kSeconds); }

  std::array<Bucket, kSeconds> buckets_ = {};
};

}  // namespace marble::server
