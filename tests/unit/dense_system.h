// The residual (13), its Jacobian and the condensed matrix written out with dense matrices and the formulas
// as they stand in the paper: what the solver's own code is held against. Shares only the data with it.
#pragma once

#include <Eigen/Core>

#include "kkt/kkt.h"
#include "model/residual.h"

namespace marble::testing {

[[nodiscard]] Eigen::MatrixXd dense(const RowMatrix& m);

[[nodiscard]] Eigen::MatrixXd dense(const SymmetricMatrix& m);

// The retraction (4) as printed; good to about 1e-9 while |σ| and √κ are of a size.
[[nodiscard]] double p(double sigma, double kappa);

[[nodiscard]] double p_slope(double sigma, double kappa);

[[nodiscard]] double p_curvature(double sigma, double kappa);

/// r(x) of (13) with equality constraints, in the segments of Iterate.
[[nodiscard]] Vector literal_residual(const ScaledProblem& problem, const Subproblem& sub, const Iterate& x);

/// q = −p″(σ)(λ_L + λ_R), at least 0 if clipped; by the exponential retraction −(s λ_L + t λ_R).
[[nodiscard]] double pair_curvature(const Subproblem& sub, const Iterate& x, Index i, bool clip);

/// Jacobian of the residual (13), rows and columns in the segments of Iterate, with δ on z and σ.
[[nodiscard]] Eigen::MatrixXd full_jacobian(const ScaledProblem& problem, const Subproblem& sub,
                                            const Iterate& x, double delta, bool clip = false);

/// [H Aᵀ; A −I/ρ] with H = Q + δI + Σ k e eᵀ, as kkt.h defines it.
[[nodiscard]] Eigen::MatrixXd dense_system(const ScaledProblem& problem, const RowWeights& weights);

}  // namespace marble::testing
