// Provides sums with an error bound.
#pragma once

#include <cmath>
#include <limits>

#include "model/tuning.h"

namespace marble {

/// Computes a sum of products as if in twice the precision (Ogita, Rump, Oishi, "Accurate sum and dot
/// product", 2005), and the sum of their sizes. The remaining error is that of the numbers themselves.
class CarefulSum {
 public:
  void add(double a, double b) {
    const double product = a * b;
    const double sum = value_ + product;
    const double part = sum - value_;
    correction_ += std::fma(a, b, -product) + ((value_ - (sum - part)) + (product - part));
    value_ = sum;
    size_ += std::abs(product);
  }
  [[nodiscard]] double value() const { return value_ + correction_; }
  /// Returns the error of the sum if its numbers are accurate to `relative`.
  [[nodiscard]] double error(double relative = tuning::roundoff) const {
    return relative * size_ + std::numeric_limits<double>::min();
  }

 private:
  double value_ = 0.0, correction_ = 0.0, size_ = 0.0;
};

}  // namespace marble
