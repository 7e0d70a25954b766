// Adds the conflict of an infeasible problem to its solution (option explain).
#pragma once

#include "marble/solver.h"

namespace marble {

/// Finds the conflict of a solution that is infeasible or locally infeasible, by deleting part after part
/// from the parts that a refutation needs (Chinneck and Dravnieks, "Locating minimal infeasible constraint
/// sets in linear programs", 1991). If a locally infeasible problem is refuted, its status becomes
/// infeasible; otherwise `detail` describes the result. The controls' `begun` and the time limit also apply
/// here. If the conflict needs no complementarity, the certificate becomes that of its rows. Other solutions
/// are unchanged.
void explain(const Problem& problem, const Options& options, const SolveControls& controls,
             const SetupControls& setup, Solution& solution);

}  // namespace marble
