// A long problem segment by segment: where one with many pairs has stages, a first answer that is cheap and
// good.
#pragma once

#include <optional>

#include "data/scaling.h"
#include "run/run.h"

namespace marble {

/// Whether a problem has so many pairs that a local search of the whole would be long: only then stages are
/// looked for.
[[nodiscard]] bool may_have_segments(const ScaledProblem& problem);

/// z and multipliers of the user's, feasible, with an objective of the user's. Nothing where the pattern has
/// no stages (find_stages), a segment has no answer, or the run was interrupted. What it takes beside the
/// problem's own solver is at most `most_bytes`. The run counts its factorizations.
[[nodiscard]] std::optional<Solution> solve_in_segments(const ScaledProblem& problem, const Options& options,
                                                        Run& run, double most_bytes);

}  // namespace marble
