// Converts iterations of coupled solves to and from rows of progress, as other solves report them.
#pragma once

#include "marble/composite/coupled.h"
#include "marble/progress.h"

namespace marble {

/// Returns an iteration as a row of progress at a time in seconds since the solve began; `frozen` is not
/// included.
[[nodiscard]] Progress row_of(const CoupledIteration& iteration, double elapsed_s);
/// Converts a row back.
[[nodiscard]] CoupledIteration coupled_iteration_of(const Progress& row);

}  // namespace marble
