// Checks a point against the tolerances of the options.
#pragma once

#include "marble/options.h"
#include "marble/solution.h"

namespace marble {

/// True if all three violations are within `factor` times their tolerances.
[[nodiscard]] inline bool within_tolerances(const Violations& violations, const Options& options,
                                            double factor = 1.0) {
  return violations.equality <= factor * options.equality_tolerance &&
         violations.inequality <= factor * options.inequality_tolerance &&
         violations.complementarity <= factor * options.complementarity_tolerance;
}

}  // namespace marble
