// Estimates the memory of a sample-average stage from sizes alone.
#pragma once

#include "composite/stages.h"

namespace marble {

/// Returns the bytes of one scenario's stored numbers.
[[nodiscard]] double bytes_of(const ScenarioNumbers& numbers);

/// Returns the least memory of a stage with this many scenarios: their numbers, its LCQP, the start and the
/// solution, the solution by scenario both as stored and as returned, and a solver.
[[nodiscard]] double stage_bytes(const Stages& stages, double scenarios, double scenario_bytes,
                                 const Options& options);

}  // namespace marble
