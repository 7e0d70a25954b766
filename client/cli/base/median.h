// The middle of numbers in any order.
#pragma once

#include <algorithm>
#include <vector>

namespace marble::cli {

/// The mean of the two in the middle where they are even in number, 0 where there is none.
[[nodiscard]] inline double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

}  // namespace marble::cli
