// Provides the softplus retraction (4), s = p(σ), t = p(−σ) with s·t = κ exactly and both positive, and the
// exponential retraction with which the paper compares it.
#pragma once

#include <cmath>

#include "marble/options.h"

namespace marble {

/// p(σ) = ½(σ + √(σ² + 4κ)) and p(−σ) = κ / p(σ); the smaller one without cancellation. Requires κ > 0.
struct Softplus {
  double positive;  ///< p(σ)
  double negative;  ///< p(−σ)
  double root;      ///< √(σ² + 4κ)

  Softplus(double sigma, double kappa) : root(std::sqrt(sigma * sigma + 4.0 * kappa)) {
    const double large = 0.5 * (std::abs(sigma) + root);
    const double small = kappa / large;
    positive = sigma >= 0.0 ? large : small;
    negative = sigma >= 0.0 ? small : large;
  }

  [[nodiscard]] double slope() const { return positive / root; }           ///< a = p′(σ) in (0, 1)
  [[nodiscard]] double negative_slope() const { return negative / root; }  ///< b = p′(−σ) = 1 − a
  /// p″(σ) = 2κ / (σ² + 4κ)^{3/2}, even in σ; κ is written as p(σ)·p(−σ).
  [[nodiscard]] double curvature() const { return 2.0 * positive * negative / (root * root * root); }
};

/// √κ·e^σ and √κ·e^−σ, each its own slope up to the sign. They and everything computed from them are
/// unbounded.
struct Exponential {
  double positive, negative;

  Exponential(double sigma, double kappa)
      : positive(std::sqrt(kappa) * std::exp(sigma)), negative(std::sqrt(kappa) * std::exp(-sigma)) {}
};

/// The sides s and t of a pair at σ, by either retraction. Inequalities always use the softplus: (12) depends
/// on it.
class PairCurve {
 public:
  PairCurve(Retraction retraction, double sigma, double kappa)
      : PairCurve(retraction == Retraction::softplus ? of(Softplus(sigma, kappa))
                                                     : of(Exponential(sigma, kappa))) {}

  /// Returns σ of the point of the curve with this s − t.
  [[nodiscard]] static double sigma_of(Retraction retraction, double difference, double kappa) {
    return retraction == Retraction::softplus ? difference
                                              : std::asinh(difference / (2.0 * std::sqrt(kappa)));
  }

  double s, t;
  [[nodiscard]] double a() const { return s / root_; }  ///< s′(σ)
  [[nodiscard]] double b() const { return t / root_; }  ///< −t′(σ)
  /// s″(σ)·λ_L + t″(σ)·λ_R
  [[nodiscard]] double bend(double lambda_L, double lambda_R) const {
    return exponential_ ? s * lambda_L + t * lambda_R
                        : 2.0 * s * t / (root_ * root_ * root_) * (lambda_L + lambda_R);
  }

 private:
  PairCurve(double s_side, double t_side, double root, bool exponential)
      : s(s_side), t(t_side), root_(root), exponential_(exponential) {}
  static PairCurve of(const Softplus& p) { return {p.positive, p.negative, p.root, false}; }
  static PairCurve of(const Exponential& e) { return {e.positive, e.negative, 1.0, true}; }

  double root_;  // 1 for the exponential retraction, whose sides are their own slopes
  bool exponential_;
};

}  // namespace marble
