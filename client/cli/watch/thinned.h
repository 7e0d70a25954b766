// Provides a history of bounded length over any duration.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace marble::cli {

/// Keeps the first value, the newest, and evenly spaced ones between: when there are `kMost`, every second
/// one is removed, and from then on only every second new one is kept.
template <class T, std::size_t kMost>
class Thinned {
  static_assert(kMost >= 4 && kMost % 2 == 0);

 public:
  void add(const T& value) {
    if (newest_only_) values_.pop_back();
    if (values_.size() == kMost) halve();
    newest_only_ = count_ % stride_ != 0;
    values_.push_back(value);
    ++count_;
  }
  /// Oldest first; at most kMost + 1.
  [[nodiscard]] std::span<const T> values() const { return values_; }
  [[nodiscard]] std::size_t stride() const { return stride_; }

 private:
  void halve() {
    for (std::size_t i = 0; 2 * i < values_.size(); ++i) values_[i] = values_[2 * i];
    values_.resize(kMost / 2);
    stride_ *= 2;
  }

  std::vector<T> values_;
  std::size_t stride_ = 1, count_ = 0;
  bool newest_only_ = false;  // the last value is only kept as the newest, and is replaced by the next
};

}  // namespace marble::cli
