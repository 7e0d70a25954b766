// Searches for better branches of a monolithic problem, near the one that its blocks found.
#pragma once

#include "marble/composite/coupled.h"

namespace marble {

/// Returns `start` or a better solution, with the factorizations spent in `factorizations`. Searches from the
/// branch of `start` as a cold solve does once it has a branch.
[[nodiscard]] Solution search_near(const Problem& problem, Solution start, const Options& options,
                                   const CoupledControls& controls);

}  // namespace marble
