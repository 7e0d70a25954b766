// Whether a point that an engine calls solved is one in the sense of a check that knows nothing of engines.
#pragma once

#include "data/residual.h"
#include "marble/options.h"

namespace marble {

/// Whether each entry of the stationarity is small: by the tolerance that an almost solved point has, or
/// against the largest term that it is the sum of. An entry with one large term, as Qz of a z of 10²⁰ that is
/// far from any solution, is not, however large z is.
[[nodiscard]] bool is_balanced(const ScaledProblem& problem, const Options& options, const Images& images,
                               const Iterate& x);

/// Whether each entry of the stationarity has a first digit in the user's units: small against 1 + the
/// largest term that it is the sum of. A point that is balanced in the scaled problem may lack it where the
/// numbers of a row or column lie so far apart that its scale hides the rest.
[[nodiscard]] bool is_balanced_in_user_units(const ScaledProblem& problem, const Images& images,
                                             const Iterate& x);

}  // namespace marble
