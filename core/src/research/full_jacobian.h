// The whole derivative of the KKT residual (13), which Newton condenses; used only for its condition number.
#pragma once

#include <Eigen/SparseCore>

#include "model/residual.h"

namespace marble {

/// Returns ∇r at x with δ on z and σ; rows and columns in the segments of Iterate.
[[nodiscard]] Eigen::SparseMatrix<double> full_jacobian(const ScaledProblem& problem, const Subproblem& sub,
                                                        const Iterate& x, double delta);

/// Returns ‖M‖₁·‖M⁻¹‖₁, with the lower bound on ‖M⁻¹‖₁ of Hager (1984) and Higham (1988): usually exact,
/// rarely less than a third of the value. Infinite if M is singular.
[[nodiscard]] double condition_estimate(const Eigen::SparseMatrix<double>& matrix);

}  // namespace marble
