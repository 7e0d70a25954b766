// The server's activity in the last five minutes, in a ring, for a page that is opened now.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "jobs/timer.h"
#include "mutex.h"

namespace marble::server {

/// Samples the server twice a second, with or without viewers. 40 KiB.
class ServerHistory final : public TimerListener {
 public:
  static constexpr std::size_t kMostPoints = 640;  // a little more than five minutes
  static constexpr std::chrono::milliseconds kEvery{500};

  struct Point {
    double time_s = 0.0;  ///< since the server started
    double queued = 0.0, running = 0.0;
    double done = 0.0;                   ///< jobs and updates with a result since the start
    double busy_s = 0.0, cpu_s = 0.0;    ///< seconds since the start
    double median_s = 0.0, p99_s = 0.0;  ///< time from acceptance to result, in the last seconds; NaN: none
  };

  explicit ServerHistory(std::function<Point()> look) : look_(std::move(look)) {}

  void on_timer(Clock::time_point now) override ABSL_LOCKS_EXCLUDED(mutex_) {
    if (now < next_) return;
    next_ = (now - next_ < kEvery ? next_ : now) + kEvery;  // at a fixed rate, unless the timer was delayed
    const Point point = look_();
    const MutexLock lock(mutex_);
    points_[static_cast<std::size_t>(count_++) % kMostPoints] = point;
  }

  /// Oldest first.
  [[nodiscard]] std::vector<Point> points() const ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    const auto kept = std::min(static_cast<std::size_t>(count_), kMostPoints);
    std::vector<Point> points;
    points.reserve(kept);
    for (std::size_t back = kept; back > 0; --back)
      points.push_back(points_[(static_cast<std::size_t>(count_) - back) % kMostPoints]);
    return points;
  }

 private:
  const std::function<Point()> look_;
  Clock::time_point next_ = {};  // used by the timer only
  mutable Mutex mutex_;
  std::array<Point, kMostPoints> points_ ABSL_GUARDED_BY(mutex_) = {};
  std::int64_t count_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::server
