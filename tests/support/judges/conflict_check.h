// Whether a conflict is one, and minimal, by enumeration: shares no code with the solver.
#pragma once

#include "marble/problem.h"
#include "marble/report/conflict.h"

namespace marble::testing {

/// Whether these parts of a problem have a point: of each choice of the sides that are zero, what
/// brute_force() says of the rows that are left. For conflicts of at most 12 complementarities.
[[nodiscard]] bool have_point(const ProblemView& problem, const Conflict& parts);

/// Whether the parts have a point as soon as any one of them is left out.
[[nodiscard]] bool is_irreducible(const ProblemView& problem, const Conflict& parts);

}  // namespace marble::testing
