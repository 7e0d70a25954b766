// The newest progress of one solve: the worker adds rows, the stream takes them when it can. The worker
// never waits; a slow reader costs bounded memory and loses the oldest rows.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <vector>

#include "marble/progress.h"
#include "mutex.h"

namespace marble::server {

class ProgressSlot {
 public:
  static constexpr std::size_t kMostRows = 128;
  /// A message costs more than an iteration of a small problem, so rows are sent together: this many, or the
  /// rows of this period.
  static constexpr std::size_t kTogether = kMostRows / 4;
  static constexpr std::chrono::milliseconds kTogetherFor{5};
  /// A solve without a row for this long reports its activity: sooner if nothing was reported yet.
  static constexpr std::chrono::milliseconds kQuietAtFirst{50}, kQuiet{400};

  struct Rows {
    std::vector<Progress> rows;      ///< oldest first, without vectors
    std::vector<double> newest_z;    ///< the iterate of the last row, if requested
    std::int64_t skipped = 0;        ///< rows of this solve that were dropped so far
    std::int64_t newly_skipped = 0;  ///< rows dropped since the last take
  };

  ProgressSlot() { ring_.reserve(kMostRows); }

  void put(const Progress& progress, bool with_iterate) {
    const MutexLock lock(mutex_);
    if (ring_.size() < kMostRows) {
      ring_.push_back(without_vectors(progress));
    } else {
      ring_[oldest_] = without_vectors(progress);
      oldest_ = (oldest_ + 1) % kMostRows;
      ++skipped_;
    }
    newest_z_.assign(progress.z.begin(), with_iterate ? progress.z.end() : progress.z.begin());
  }

  /// A worker has begun the solve.
  void started() {
    const MutexLock lock(mutex_);
    quiet_until_ = Clock::now() + kQuietAtFirst;
  }

  /// The solve is over; another one may follow.
  void reset() {
    const MutexLock lock(mutex_);
    quiet_until_ = Clock::time_point::max();
    ring_.clear();
    oldest_ = 0;
    skipped_ = 0;
    skipped_before_ = 0;
    next_ = {};
  }

  /// Returns the rows since the last take; none if nothing is new.
  [[nodiscard]] Rows take() {
    const MutexLock lock(mutex_);
    std::rotate(ring_.begin(), ring_.begin() + static_cast<std::ptrdiff_t>(oldest_), ring_.end());
    Rows taken{ring_, newest_z_, skipped_, skipped_ - skipped_before_};
    skipped_before_ = skipped_;
    ring_.clear();
    oldest_ = 0;
    const Clock::time_point now = Clock::now();
    if (!taken.rows.empty()) next_ = now + kTogetherFor;
    if (quiet_until_ != Clock::time_point::max()) quiet_until_ = now + kQuiet;
    return taken;
  }

  /// True if a solve is running and nothing was taken from it for a while.
  [[nodiscard]] bool is_quiet() const {
    const MutexLock lock(mutex_);
    return Clock::now() >= quiet_until_;
  }

  /// True if rows should be sent now: a first row, and one with an iterate, at once; rows that came too soon
  /// after it at a later call.
  [[nodiscard]] bool due() const {
    const MutexLock lock(mutex_);
    if (ring_.empty()) return false;
    return ring_.size() >= kTogether || !newest_z_.empty() || Clock::now() >= next_;
  }

 private:
  using Clock = std::chrono::steady_clock;

  mutable Mutex mutex_;
  std::vector<Progress> ring_ ABSL_GUARDED_BY(mutex_);
  std::size_t oldest_ ABSL_GUARDED_BY(mutex_) = 0;  // 0 unless the ring is full
  std::vector<double> newest_z_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point next_ ABSL_GUARDED_BY(mutex_) = {};  // when rows are due, even if few
  Clock::time_point quiet_until_ ABSL_GUARDED_BY(mutex_) = Clock::time_point::max();
  std::int64_t skipped_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t skipped_before_ ABSL_GUARDED_BY(mutex_) = 0;  // value of skipped at the last take
};

}  // namespace marble::server
