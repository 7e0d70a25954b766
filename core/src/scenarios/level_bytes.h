// The memory of a level, by sizes alone.
#pragma once

#include "scenarios/stages.h"

namespace marble {

/// Of one scenario's numbers, as they are kept.
[[nodiscard]] double bytes_of(const ScenarioNumbers& numbers);

/// What a level of so many scenarios takes at least: their numbers, its LCQP, the start and the answer to it,
/// the answer by scenario and once more as it is given, and a solver.
[[nodiscard]] double level_bytes(const Stages& stages, double scenarios, double scenario_bytes,
                                 const Options& options);

}  // namespace marble
