// Extends a solution for N scenarios to a start for more scenarios.
#pragma once

#include <span>
#include <vector>

#include "composite/stages.h"
#include "model/interrupt.h"

namespace marble {

/// Returns one scenario's part of a solution to an assembled problem, with the multipliers of a scenario of
/// weight one.
[[nodiscard]] Solution scenario_part(const Stages& stages, const Solution& answer, std::size_t scenario,
                                     double weight);

/// Joins the plan's part of a solution to an assembled problem and the parts of scenarios, each with its
/// multipliers times its weight. If the new scenarios repeat the old ones, the result solves the new problem.
[[nodiscard]] Solution lifted(const Stages& stages, const Solution& answer,
                              std::span<const Solution* const> parts, std::span<const double> weights);

/// Returns the scenario of `known` with the nearest numbers, the first one if several are equally near. If
/// the checkpoint ends the search, only the scenarios compared until then count.
[[nodiscard]] std::size_t nearest(const Stages& stages, const ScenarioNumbers& scenario,
                                  std::span<const ScenarioNumbers> known, Checkpoint& checkpoint);

/// Returns each scenario's weight divided by the sum of all weights.
[[nodiscard]] std::vector<double> normalized_weights(std::span<const ScenarioNumbers> scenarios);

}  // namespace marble
