// Solves a long problem segment by segment: a cheap and good first solution for problems with many pairs and
// with stages.
#pragma once

#include <optional>

#include "model/scaling.h"
#include "path/run.h"

namespace marble {

/// True if a problem has so many pairs that a local search of the whole would take long. Only then the solver
/// looks for stages.
[[nodiscard]] bool may_have_segments(const ScaledProblem& problem);

/// Returns a feasible z, multipliers and objective in the user's units. Returns nothing if the pattern has no
/// stages (find_stages), a segment has no solution, or the run was interrupted. Takes at most `most_bytes`
/// beside the problem's own solver. The run counts the factorizations.
[[nodiscard]] std::optional<Solution> solve_in_segments(const ScaledProblem& problem, const Options& options,
                                                        Run& run, double most_bytes);

}  // namespace marble
