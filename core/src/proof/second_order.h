// Checks the second-order conditions of a stationary point, and finds a descent direction if they fail.
//
// With linear constraints, a stationary point is a local minimum if and only if vᵀQv ≥ 0 for every v of its
// critical cone: rows with a multiplier stay at zero, other active rows may grow (Majthay 1971, Contesse
// 1980; Nocedal and Wright, "Numerical Optimization", 2006, ch. 12 and 16). With pairs, this must hold for
// the cone of every branch that the point belongs to.
#pragma once

#include <optional>

#include "branch/branch_point.h"

namespace marble {

/// Result of the test of Q's curvature over the critical cone.
struct CriticalCurvature {
  SecondOrder kind = SecondOrder::unknown;  ///< minimum, necessary or saddle, as far as curvature decides
  Vector direction;                         ///< saddle: v of the cone (scaled), vᵀQv < 0
  WorkingSet set;                           ///< saddle: rows that stay at zero along v
};

/// Tests an exact solution whose working set leaves no negative curvature. If all rows of that set have
/// multipliers, it is a minimum at no cost. Otherwise the test takes one factorization with all active rows,
/// one solve per weakly active row, and a test of copositivity. It is exact if these rows are few and
/// independent; otherwise the result is `necessary`.
[[nodiscard]] CriticalCurvature critical_curvature(const ScaledProblem& p, Kkt& kkt, const Iterate& x,
                                                   const WorkingSet& set, Run& run);

/// True if critical_curvature() has anything to do.
[[nodiscard]] bool has_weakly_active_rows(const ScaledProblem& p, const Iterate& x, const WorkingSet& set);

}  // namespace marble
