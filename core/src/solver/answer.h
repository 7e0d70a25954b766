// Makes the user's solution from the point at which a run ended.
#pragma once

#include "marble/solution.h"
#include "path/run.h"
#include "path/termination.h"

namespace marble {

/// Returns whether every number of a solution is finite.
[[nodiscard]] bool is_finite(const Solution& solution);

/// Sets z, multipliers, objective, violations and kkt_residual of a point, in the user's units.
void take_point(const ScaledProblem& problem, const Iterate& x, Images& images, Solution& solution);

/// Makes the solution, in which every number is finite. It is not solved if the run reports a point as solved
/// that is not, or as almost solved that is so only in the scaled problem; it is almost_solved if the point
/// is solved only there.
[[nodiscard]] Solution answer(const ScaledProblem& problem, const Options& options, const Ending& ending,
                              const Iterate& x, const Run& run);

}  // namespace marble
