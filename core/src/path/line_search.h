// Filter line search of Wächter and Biegler (2006) on the inner problem.
//
// With e = (λ − α)/ρ for every constraint, (13) are the optimality conditions of
//   min f(z) − κ Σ log w + αᵀe + ½ρ‖e‖²   s.t.   c(z, v, σ) + … − e = 0,
// so θ is the 1-norm of the residuals of those constraints, and φ is the objective of this problem.
#pragma once

#include <vector>

#include "model/residual.h"

namespace marble {

/// The measures by which the filter compares points.
struct Measures {
  double theta, phi;
};

/// Returns θ and φ at x + αd, from the images of both.
Measures measure(const Subproblem& sub, const Images& at, const Images& along, const Iterate& x,
                 const Iterate& d, double alpha);

/// Returns dφ/dα at α = 0.
double phi_slope(const Subproblem& sub, const Images& at, const Iterate& x, const Iterate& d);

class FilterLineSearch {
 public:
  explicit FilterLineSearch(const ScaledProblem& problem);

  /// Empties the filter. Required when κ, ρ or the estimates change, since φ is then another function.
  void reset();

  /// Returns the largest acceptable α in {1, ½, ¼, …} along d, or 0 if there is none above a smallest step.
  double search(const Subproblem& sub, const Images& at, const Images& along, const Iterate& x,
                const Iterate& d);

 private:
  [[nodiscard]] bool acceptable(const Measures& trial) const;
  void add(const Measures& current);

  std::vector<Measures> filter_;  // no later point may be dominated by these
  std::size_t capacity_;
  double theta_max_ = 0.0, theta_min_ = 0.0;
  bool started_ = false;
};

/// Returns ‖r(x + αd)‖∞ of (13) without any product with a matrix.
double residual_norm(const Subproblem& sub, const Images& at, const Images& along, const Iterate& x,
                     const Iterate& d, double alpha);

}  // namespace marble
