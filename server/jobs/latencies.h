// Recent latencies, as counts in buckets: one second of time by a twentieth of a decade of latency. No
// threads, no clock.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>

namespace marble::server {

/// Uses 45 KiB, for any number of results.
class Latencies {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::int64_t kSeconds = 60;        ///< seconds that are kept
  static constexpr std::int64_t kNewestSeconds = 10;  ///< seconds for a curve

  struct Quantiles {
    double median_s = std::numeric_limits<double>::quiet_NaN();  ///< NaN: there were no results
    double p99_s = median_s;
  };

  /// Adds one result. Time does not go back.
  void add(Time now, double took_s) {
    Slice& slice = slices_[place_of(second_of(now))];
    if (slice.second != second_of(now)) slice = {second_of(now), {}};
    ++slice.counts[bucket_of(took_s)];
  }

  /// Returns the quantiles over the last `seconds`, to 6 %.
  [[nodiscard]] Quantiles quantiles(Time now, std::int64_t seconds = kSeconds) const {
    Counts counts = {};
    for (const Slice& slice : slices_) {
      if (slice.second <= second_of(now) - seconds) continue;
      for (std::size_t at = 0; at < kBuckets; ++at) counts[at] += slice.counts[at];
    }
    return {quantile(counts, 0.5), quantile(counts, 0.99)};
  }

 private:
  static constexpr double kPerDecade = 20.0;
  static constexpr double kLeast = -5.0;           // decade of the first bucket: 10 µs
  static constexpr std::size_t kBuckets = 9 * 20;  // to 10,000 s
  using Counts = std::array<std::uint32_t, kBuckets>;
  struct Slice {
    std::int64_t second = -kSeconds;
    Counts counts = {};
  };

  static std::size_t bucket_of(double took_s) {
    const double at = (std::log10(std::max(took_s, 1e-9)) - kLeast) * kPerDecade;
    return static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(kBuckets - 1)));
  }
  static double quantile(const Counts& counts, double share) {
    std::uint64_t all = 0;
    for (const std::uint32_t count : counts) all += count;
    if (all == 0) return std::numeric_limits<double>::quiet_NaN();
    const auto rank = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(all)));
    std::uint64_t below = 0;
    std::size_t at = 0;
    while ((below += counts[at]) < rank) ++at;
    return std::pow(10.0, kLeast + (static_cast<double>(at) + 0.5) / kPerDecade);
  }
  static std::int64_t second_of(Time time) {
    return std::chrono::duration_cast<std::chrono::seconds>(time.time_since_epoch()).count();
  }
  static std::size_t place_of(std::int64_t second) { return static_cast<std::size_t>(second % kSeconds); }

  std::array<Slice, kSeconds> slices_ = {};
};

}  // namespace marble::server
