// The softplus retraction (4): s = p(σ), t = p(−σ) with s·t = κ exactly and both positive.
#pragma once

#include <cmath>

namespace marble {

/// p(σ) = ½(σ + √(σ² + 4κ)) and p(−σ) = κ / p(σ), the smaller one without cancellation. Needs κ > 0.
struct Retraction {
  double positive;  ///< p(σ)
  double negative;  ///< p(−σ)
  double root;      ///< √(σ² + 4κ)

  Retraction(double sigma, double kappa) : root(std::sqrt(sigma * sigma + 4.0 * kappa)) {
    const double large = 0.5 * (std::abs(sigma) + root);
    const double small = kappa / large;
    positive = sigma >= 0.0 ? large : small;
    negative = sigma >= 0.0 ? small : large;
  }

  [[nodiscard]] double slope() const { return positive / root; }           ///< a = p′(σ) in (0, 1)
  [[nodiscard]] double negative_slope() const { return negative / root; }  ///< b = p′(−σ) = 1 − a
  /// p″(σ) = 2κ / (σ² + 4κ)^{3/2}, even in σ; written with p(σ)·p(−σ) for κ.
  [[nodiscard]] double curvature() const { return 2.0 * positive * negative / (root * root * root); }
};

}  // namespace marble
