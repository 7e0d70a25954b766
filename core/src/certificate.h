// Proofs that there is no solution.
#pragma once

#include <vector>

#include "residual.h"

namespace marble {

/// If the iterate's multipliers, normalised, prove that even the relaxation without complementarity is
/// infeasible (Farkas: Aᵀy − Cᵀν − Lᵀξ − Rᵀη = 0, ν, ξ, η ≥ 0 and bᵀy − dᵀν − lᵀξ − rᵀη = 1), returns (y, ν,
/// ξ, η) stacked and unscaled, else nothing.
std::vector<double> infeasibility_certificate(const ScaledProblem& p, const Iterate& x);

/// If the iterate runs off along a direction d with gᵀd < 0, Qd = 0, Ad = 0, Cd ≥ 0, min(Ld, Rd) = 0, returns
/// d (n, unscaled, largest entry 1), else nothing.
std::vector<double> unbounded_direction(const ScaledProblem& p, const Iterate& x);

/// The constraints without complementarity as inequalities of a problem without cost: its elastic optimum has
/// the least violation, and violations that are left are a proof (Farkas).
[[nodiscard]] ScaledProblem feasibility_relaxation(const ScaledProblem& p);

}  // namespace marble
