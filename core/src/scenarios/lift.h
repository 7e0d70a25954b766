// An answer for N worlds as the start for more of them.
#pragma once

#include <span>
#include <vector>

#include "data/interrupt.h"
#include "scenarios/stages.h"

namespace marble {

/// The part of one world in an answer to an assembled problem, with multipliers of a world of weight one.
[[nodiscard]] Solution world_part(const Stages& stages, const Solution& answer, std::size_t world,
                                  double weight);

/// The plan's part of an answer to an assembled problem, then worlds' parts: each with its multipliers times
/// its weight. An answer so lifted solves the new problem where its worlds are the old ones, repeated.
[[nodiscard]] Solution lifted(const Stages& stages, const Solution& answer,
                              std::span<const Solution* const> parts, std::span<const double> weights);

/// Of `known`, the world whose numbers are nearest: the first of those that are as near. Of those that it has
/// looked at where the checkpoint ends it.
[[nodiscard]] std::size_t nearest(const Stages& stages, const ScenarioNumbers& world,
                                  std::span<const ScenarioNumbers> known, Checkpoint& checkpoint);

/// Each world's weight over their sum.
[[nodiscard]] std::vector<double> normalized_weights(std::span<const ScenarioNumbers> worlds);

}  // namespace marble
