// Newton's method on min(s, t) = 0, if equalities and one side of each pair determine z: a mixed
// complementarity problem. Each step solves the branch of the smaller sides, whatever the sign of the others;
// then the pairs whose other side is negative switch. (Pang, "Newton's method for B-differentiable
// equations", 1990; for obstacle problems it is Howard's policy iteration.) From a point near the solution,
// such as the end of the path, it takes a few steps, however many pairs are undecided.
#pragma once

#include "branch/branch_point.h"
#include "path/run.h"

namespace marble {

/// True if the method applies: as many unknowns as equalities and pairs, and no inequality.
[[nodiscard]] bool pair_newton_applies(const ScaledProblem& problem);

/// Starts from the branch at `point`. Returns true if it ends on a branch whose rows determine a point
/// without negative sides, which is then in `point`. Returns false if the sum of the negative sides does not
/// fall, if it takes more than tuning::engine_budget, or if a branch is singular.
[[nodiscard]] bool pair_newton(Run& run, const ScaledProblem& problem, BranchPoint& point);

}  // namespace marble
