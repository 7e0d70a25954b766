// The least or largest value of a row over bounds of its variables.
#pragma once

#include <cmath>
#include <limits>

namespace marble {

/// The minimum or maximum of Σ a z of a row over a box: the sum of the finite terms, and the number of
/// infinite ones.
struct RowActivity {
  double sum = 0.0, size = 0.0;
  int infinite = 0;

  void add(double term) {
    if (std::isfinite(term)) {
      sum += term;
      size += std::abs(term);
    } else {
      ++infinite;
    }
  }
  /// Returns the sum of the other terms; infinite if one of them is.
  [[nodiscard]] double without(double term) const {
    if (std::isfinite(term)) return infinite > 0 ? std::numeric_limits<double>::infinity() : sum - term;
    return infinite > 1 ? std::numeric_limits<double>::infinity() : sum;
  }
};

}  // namespace marble
