// Second-order conditions of a stationary point, and the way on where they fail.
//
// With linear constraints a stationary point is a local minimum exactly if vᵀQv ≥ 0 for every v of its
// critical cone: rows with a multiplier stay at zero, other active rows may grow (Majthay 1971, Contesse
// 1980; Nocedal and Wright, "Numerical Optimization", 2006, ch. 12 and 16). For pairs the cone is that of
// every branch the point belongs to.
#pragma once

#include <optional>

#include "branch/branch_point.h"

namespace marble {

/// What is known of the curvature of Q over the critical cone.
struct CriticalCurvature {
  SecondOrder kind = SecondOrder::unknown;  ///< minimum, necessary or saddle, as far as curvature decides
  Vector direction;                         ///< saddle: v of the cone (scaled), vᵀQv < 0
  WorkingSet set;                           ///< saddle: rows that stay at zero along v
};

/// Of an exact solution, whose working set leaves no negative curvature: where all rows of that set have
/// multipliers this says minimum at no cost. Else one factorization with all active rows, a solve for each
/// weakly active one and copositivity of what they leave: exact where they are few and independent, else
/// `necessary`.
[[nodiscard]] CriticalCurvature critical_curvature(const ScaledProblem& p, Kkt& kkt, const Iterate& x,
                                                   const WorkingSet& set, Run& run);

/// Whether critical_curvature() has to do anything.
[[nodiscard]] bool has_weakly_active_rows(const ScaledProblem& p, const Iterate& x, const WorkingSet& set);

}  // namespace marble
