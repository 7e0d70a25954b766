// The published methods that option `method` offers for comparison. They are a library of their own,
// marble_research: servers, clients and wheels do not contain it.
#pragma once

#include "marble/options.h"
#include "marble/problem.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble::research {

/// Returns the published methods, for SetupControls::reference_methods.
[[nodiscard]] const ReferenceMethods& reference_methods();

/// As marble::solve_in_process, by every value of option `method`.
[[nodiscard]] Expected<Solution> solve_in_process(const ProblemView& problem, const Options& options = {},
                                                  const SolveControls& controls = {});

}  // namespace marble::research
