// Decides whether an independent check would accept a point that an engine considers solved.
#pragma once

#include "marble/options.h"
#include "model/residual.h"

namespace marble {

/// True if each entry of the stationarity is small: within the tolerance of an almost solved point, or
/// relative to the largest term of its sum. An entry with one large term, such as Qz for a z of 10²⁰ far from
/// any solution, fails this test, however large z is.
[[nodiscard]] bool is_balanced(const ScaledProblem& problem, const Options& options, const Images& images,
                               const Iterate& x);

/// True if each entry of the stationarity is correct to a first digit in the user's units: small relative to
/// 1 + the largest term of its sum. A point that is balanced in the scaled problem may fail this if the
/// numbers of a row or column differ so much that its scale hides the smaller ones.
[[nodiscard]] bool is_balanced_in_user_units(const ScaledProblem& problem, const Images& images,
                                             const Iterate& x);

}  // namespace marble
