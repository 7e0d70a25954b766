// Counts values in log-linear buckets: any quantile to three digits, in bounded memory.
#pragma once

#include <cstdint>
#include <vector>

namespace marble::load {

/// Holds values from 0 to 2⁶³ in any unit (here nanoseconds). Below 2048 each value has its own bucket;
/// above, every power of two is divided into 1024 equal ones, so that a bucket is less than 0.1 % wide.
class Histogram {
 public:
  void add(std::int64_t value, std::uint64_t times = 1);  ///< below 0 counts as 0
  void merge(const Histogram& other);
  void clear();

  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] std::int64_t least() const { return count_ == 0 ? 0 : least_; }
  [[nodiscard]] std::int64_t most() const { return most_; }
  [[nodiscard]] double mean() const;

  /// Returns the smallest value that at least this part of all values, in [0, 1], does not exceed, up to the
  /// width of its bucket and never too small; 0 without values.
  [[nodiscard]] std::int64_t quantile(double part) const;

  /// For plots: each filled bucket's largest value, and the part of all values up to it.
  struct Step {
    std::int64_t value = 0;
    double part = 0.0;
  };
  [[nodiscard]] std::vector<Step> steps() const;

 private:
  std::vector<std::uint64_t> buckets_;  // up to the largest one used
  std::uint64_t count_ = 0;
  std::int64_t least_ = 0, most_ = 0;
  double sum_ = 0.0;
};

}  // namespace marble::load
