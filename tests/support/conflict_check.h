// Checks by enumeration that a conflict is one, and that it is minimal: shares no code with the solver.
#pragma once

#include "marble/problem.h"
#include "marble/report/conflict.h"

namespace marble::testing {

/// Returns whether these parts of a problem have a common point: for each choice of zero sides, applies
/// brute_force() to the remaining rows. For conflicts of at most 12 complementarities.
[[nodiscard]] bool have_point(const ProblemView& problem, const Conflict& parts);

/// Returns whether the parts have a common point after removal of any one of them.
[[nodiscard]] bool is_irreducible(const ProblemView& problem, const Conflict& parts);

}  // namespace marble::testing
