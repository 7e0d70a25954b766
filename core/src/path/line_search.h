// Filter line search of Wächter and Biegler (2006) on the inner problem.
//
// With e = (λ − α)/ρ for every constraint, (13) are the optimality conditions of
//   min f(z) − κ Σ log w + αᵀe + ½ρ‖e‖²   s.t.   c(z, v, σ) + … − e = 0,
// so θ is the 1-norm of those constraints' residuals and φ the objective of this problem.
#pragma once

#include <vector>

#include "data/residual.h"

namespace marble {

/// What the filter compares points by.
struct Measures {
  double theta, phi;
};

/// θ and φ at x + αd, from the images of both.
Measures measure(const Subproblem& sub, const Images& at, const Images& along, const Iterate& x,
                 const Iterate& d, double alpha);

/// dφ/dα at α = 0.
double phi_slope(const Subproblem& sub, const Images& at, const Iterate& x, const Iterate& d);

class FilterLineSearch {
 public:
  explicit FilterLineSearch(const ScaledProblem& problem);

  /// Forgets all: whenever κ, ρ or the estimates change, φ is another function.
  void reset();

  /// Largest acceptable α in {1, ½, ¼, …} along d, 0 if there is none above a smallest step.
  double search(const Subproblem& sub, const Images& at, const Images& along, const Iterate& x,
                const Iterate& d);

 private:
  [[nodiscard]] bool acceptable(const Measures& trial) const;
  void add(const Measures& current);

  std::vector<Measures> filter_;  // points no later one may be dominated by
  std::size_t capacity_;
  double theta_max_ = 0.0, theta_min_ = 0.0;
  bool started_ = false;
};

/// ‖r(x + αd)‖∞ of (13) without any product with a matrix.
double residual_norm(const Subproblem& sub, const Images& at, const Images& along, const Iterate& x,
                     const Iterate& d, double alpha);

}  // namespace marble
