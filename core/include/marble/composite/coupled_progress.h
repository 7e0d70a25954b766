// An iteration of a coupled solve as a row of progress, as every other solve tells them.
#pragma once

#include "marble/composite/coupled.h"
#include "marble/progress.h"

namespace marble {

/// What an iteration's row of progress says, at a time in seconds since the solve began; `frozen` is not in
/// it.
[[nodiscard]] Progress row_of(const CoupledIteration& iteration, double elapsed_s);
/// The way back.
[[nodiscard]] CoupledIteration coupled_iteration_of(const Progress& row);

}  // namespace marble
