// Dense algebra for coupled problems that can be interrupted: LAPACK's calls would take seconds at 2000 rows.
#pragma once

#include <Eigen/Core>

#include "model/interrupt.h"

namespace marble {

/// A = V diag(values) Vᵀ by Householder reductions and implicit QR steps (Golub and Van Loan, 8.3). Reads the
/// lower triangle of `a` and writes V to `a`. Returns false if interrupted, or if it does not converge.
[[nodiscard]] bool eigen_decomposition(Eigen::MatrixXd& a, Eigen::VectorXd& values,
                                       const Interrupt& interrupt);

/// out = V diag(values) Vᵀ. Returns false if interrupted.
[[nodiscard]] bool spectral_product(const Eigen::MatrixXd& vectors, const Eigen::VectorXd& values,
                                    Eigen::Ref<Eigen::MatrixXd> out, const Interrupt& interrupt);

/// x ← A⁻¹x for a symmetric semidefinite A, by LDLᵀ with diagonal pivoting. Reads the lower triangle of `a`
/// and writes its factor there. Returns false if interrupted.
[[nodiscard]] bool solve_semidefinite(Eigen::MatrixXd& a, Eigen::VectorXd& x, const Interrupt& interrupt);

}  // namespace marble
