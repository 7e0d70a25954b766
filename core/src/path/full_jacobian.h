// The derivative of the KKT residual (13), whole: what Newton condenses. For its condition number alone.
#pragma once

#include <Eigen/SparseCore>

#include "data/residual.h"

namespace marble {

/// ∇r at x with δ on z and σ, rows and columns in the segments of Iterate.
[[nodiscard]] Eigen::SparseMatrix<double> full_jacobian(const ScaledProblem& problem, const Subproblem& sub,
                                                        const Iterate& x, double delta);

/// ‖M‖₁·‖M⁻¹‖₁, the latter from below as Hager (1984) and Higham (1988) estimate it: mostly exact, seldom
/// less than a third. Infinite where M is singular.
[[nodiscard]] double condition_estimate(const Eigen::SparseMatrix<double>& matrix);

}  // namespace marble
