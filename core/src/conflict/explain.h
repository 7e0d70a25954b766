// The conflict of an infeasible problem: what option explain adds to an answer.
#pragma once

#include "marble/solver.h"

namespace marble {

/// Of an answer that is infeasible, or locally so: its conflict, by deleting part after part from what a
/// refutation needs (Chinneck and Dravnieks, "Locating minimal infeasible constraint sets in linear
/// programs", 1991). A locally infeasible one becomes infeasible where it is refuted; else `detail` says what
/// came of it. The controls' `begun` and the time limit count for it too. Where the conflict needs no
/// complementarity the certificate becomes that of its rows. Other answers stay as they are.
void explain(const Problem& problem, const Options& options, const SolveControls& controls,
             const SetupControls& setup, Solution& solution);

}  // namespace marble
