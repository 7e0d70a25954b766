// Provides the median of numbers in any order.
#pragma once

#include <algorithm>
#include <vector>

namespace marble::cli {

/// Returns the median: the mean of the middle two for an even count, 0 for none.
[[nodiscard]] inline double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

}  // namespace marble::cli
