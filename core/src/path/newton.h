// One Newton step on the KKT residual (13), through the condensed system.
//
// Inequality i:  ω = 1 / (1/ρ + w/μ),  w = p(v), μ = p(−v).
// Pair i, with a = s′(σ), b = −t′(σ), u² = a² + b², q = −(s″λ_L + t″λ_R) + δ and the pivot π = u² + q/ρ; for
// the softplus, a = p′(σ), b = p′(−σ) and q = −p″(σ)(λ_L + λ_R) + δ:
//   weight ρ along (b, a)/u, the direction that the retraction curve cannot follow, and q/π along (a, −b)/u,
//   its tangent.
// σ, v and λ are recovered from the step in (z, y).
#pragma once

#include "kkt/kkt.h"
#include "model/residual.h"

namespace marble {

class Newton {
 public:
  Newton(const ScaledProblem& problem, Kkt& kkt);

  /// Factorizes at x with regularization δ. `clip` replaces q by max(q, 0), which gives the correct inertia
  /// for a convex Q. Returns false if the inertia is wrong.
  [[nodiscard]] bool factor(const Subproblem& sub, const Iterate& x, double delta, bool clip);

  /// Computes the step d from the residual r at x, and the images of d.
  [[nodiscard]] bool direction(const Subproblem& sub, const Iterate& x, const Iterate& r, Iterate& d,
                               Images& images);

 private:
  const ScaledProblem& problem_;
  Kkt& kkt_;
  RowWeights weights_;
  Vector pivot_;  // π of each pair
  RowVector rhs_;
};

}  // namespace marble
