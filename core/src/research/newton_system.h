// Common parts of the barrier methods' Newton systems: the 2 × 2 weight of a pair's rows, and δ.
#pragma once

#include <cmath>

#include "kkt/kkt.h"
#include "model/tuning.h"
#include "path/run.h"

namespace marble {

/// diag(a, b) + ξ [0 1; 1 0] + W (t, s)ᵀ(t, s): the curvature of each side, a multiplier ξ of the product
/// s·t, and a weight W of its linearization t ds + s dt.
struct PairBlock {
  PairBlock(double s, double t, double a, double b, double xi, double weight)
      : first(a + weight * t * t),
        second(b + weight * s * s),
        coupling(xi + weight * s * t),
        determinant(a * b + weight * (a * s * s + b * t * t - 2.0 * xi * s * t) - xi * xi) {}

  /// Writes the block, rotated to its eigenvectors (cos, sin) and (sin, −cos).
  void put(Index pair, RowWeights& weights) const {
    const double angle = 0.5 * std::atan2(2.0 * coupling, first - second);
    const double cosine = weights.cosine[pair] = std::cos(angle), sine = weights.sine[pair] = std::sin(angle);
    const double larger = first * cosine * cosine + 2.0 * coupling * cosine * sine + second * sine * sine;
    weights.rows.s()[pair] = larger;
    weights.rows.t()[pair] = determinant / larger;
  }

  double first, second, coupling;
  double determinant;  ///< first·second − coupling², computed without cancellation
};

/// Factorizes with a δ as small as the inertia allows, close to the last one; weigh() computes the weights
/// from δ. Returns false if interrupted, or if no δ works.
[[nodiscard]] bool factor_regularized(Run& run, Kkt& kkt, const RowWeights& weights, double first_delta,
                                      double& delta, auto&& weigh) {
  delta = delta > first_delta ? delta / tuning::delta_lower : 0.0;
  while (true) {
    weigh();
    ++run.factorizations;
    if (run.timed(&Times::factorization_s, [&] { return kkt.factor(weights); })) return true;
    if (run.interrupted()) return false;
    delta = delta > 0.0 ? tuning::delta_raise * delta : first_delta;
    if (!(delta <= tuning::runaway)) return false;
  }
}

}  // namespace marble
