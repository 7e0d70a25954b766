// Provides the KKT residual (13) with equalities, and the linear images of an iterate from which it is
// computed.
#pragma once

#include "marble/options.h"
#include "marble/progress.h"
#include "marble/solution.h"
#include "model/iterate.h"

namespace marble {

/// All values that are linear (or quadratic) in the iterate. They change linearly along a step, so a line
/// search needs no product with a matrix: images(x + αd) = images(x) + α·images(d).
struct Images {
  explicit Images(const ScaledProblem& p);
  Vector equality;         ///< A z + b
  RowVector rows;          ///< C z + d, L z + l, R z + r
  Vector gradient;         ///< Q z + g
  Vector stationarity;     ///< Q z + g + Aᵀy + Cᵀλ_w + Lᵀλ_L + Rᵀλ_R
  double objective = 0.0;  ///< ½ zᵀQz + gᵀz, scaled

  /// Computes all images of a point.
  void evaluate(const ScaledProblem& p, const Iterate& x);
  /// Computes only the linear parts of z without the constant terms: A z and [C; L; R] z.
  void evaluate_rows(const ScaledProblem& p, ConstVectorRef z);
  /// gradient = Q z and stationarity = Q z + Aᵀy + …, without constant terms.
  void evaluate_duals(const ScaledProblem& p, const Iterate& step);
  /// Moves a point's images by α along a direction's images.
  void advance(double alpha, const Images& direction, ConstVectorRef dz);
};

/// The problem of the inner loop: (13) for fixed κ, ρ and multiplier estimates α, β.
struct Subproblem {
  explicit Subproblem(const ScaledProblem& p)
      : equality_estimate(Vector::Zero(p.equalities())), row_estimate(p.layout) {
    row_estimate.all.setZero();
  }

  Retraction retraction = Retraction::softplus;
  double kappa = 0.0, rho = 0.0;
  Vector equality_estimate;  ///< α
  RowVector row_estimate;    ///< α of inequalities, β of pairs

  /// [α, β] ← [y, λ_w, λ_σ]
  void take_estimates(const Iterate& x) {
    equality_estimate = x.y();
    row_estimate.all = x.lambda();
  }
};

/// r(x) of (13), in the segments of the iterate.
void residual(const Subproblem& sub, const Images& images, const Iterate& x, Iterate& r);

/// Returns the violations in the user's units, from scaled images.
Violations violations(const ScaledProblem& p, const Images& images);
/// The same in the units of the scaled rows, which are near 1.
Violations scaled_violations(const RowLayout& rows, const Images& images);

}  // namespace marble
