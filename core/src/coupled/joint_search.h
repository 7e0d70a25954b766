// Better branches of a joint problem, near the one that its blocks have found.
#pragma once

#include "marble/composite/coupled.h"

namespace marble {

/// `start` or something better, with as much as it took in `factorizations`: what a cold solve does once it
/// has a branch, from this branch.
[[nodiscard]] Solution search_near(const Problem& problem, Solution start, const Options& options,
                                   const CoupledControls& controls);

}  // namespace marble
