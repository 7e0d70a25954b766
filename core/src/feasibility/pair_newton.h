// Newton's method on min(s, t) = 0 where equalities and one side of each pair determine z: a mixed
// complementarity problem. Each step solves the branch of the smaller sides, whatever the sign of the others,
// and the pairs whose other side is negative then change branches. (Pang, "Newton's method for
// B-differentiable equations", 1990; for obstacle problems it is Howard's policy iteration.) From a point
// near the solution, as the path's end is, it takes a few steps, however many pairs are undecided.
#pragma once

#include "branch/branch_point.h"
#include "run/run.h"

namespace marble {

/// Whether the method is for this problem: as many unknowns as equalities and pairs, and no inequality.
[[nodiscard]] bool pair_newton_applies(const ScaledProblem& problem);

/// From the branch at `point`. True if it ends on a branch whose rows determine a point with no negative
/// side, which is at `point` then. False where the sum of the negative sides does not fall, where it takes
/// more than tuning::pair_newton_steps, or where a branch is singular.
[[nodiscard]] bool pair_newton(Run& run, const ScaledProblem& problem, BranchPoint& point);

}  // namespace marble
