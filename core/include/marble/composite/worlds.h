// Worlds for a scenario solve by what differs: a table of numbers, or random numbers by their number.
//
//   marble::ScenarioProblem problem{.base = base.view(), .first_stage = plan};
//   auto set = marble::set_worlds(problem, marble::ScenarioSampler{.seed = 7, .quantities = {friction}});
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "marble/composite/scenarios.h"

namespace marble {

/// A part of a problem, by its numbers alone; of a matrix its stored entries. In the order of
/// ScenarioNumbers.
enum class ProblemPart { c0, g, b, d, l, r, Q, A, C, L, R };

/// Entries of one part of the base problem.
struct ScenarioEntries {
  ProblemPart part = ProblemPart::c0;     ///< whose entries
  std::span<const Index> positions = {};  ///< ascending; empty: all of them. Of a full Q the upper ones count
};

/// What differs, world by world. Borrows its arrays.
struct ScenarioTable {
  std::vector<ScenarioEntries> entries = {};  ///< the table's columns, in this order; no entry twice
  std::span<const double> values = {};        ///< a row for each world: the numbers of all these entries
  std::span<const double> weights = {};       ///< > 0, one for each world; empty: all alike
};

/// Where a random number comes from.
enum class ScenarioDistribution {
  uniform,    ///< in [location, location + scale)
  normal,     ///< location + scale · standard normal
  lognormal,  ///< exp(location + scale · standard normal)
};

/// A number that is drawn once for each world, and what it moves.
struct ScenarioQuantity {
  /// Entries that are the base's plus the number times their gains.
  struct Effect {
    ScenarioEntries entries = {};        ///< which
    std::span<const double> gains = {};  ///< one for each of them, or one for all
  };
  ScenarioDistribution distribution = ScenarioDistribution::uniform;  ///< where it comes from
  double location = 0.0;                                              ///< finite; see ScenarioDistribution
  double scale = 1.0;                                                 ///< finite, >= 0
  double least = -std::numeric_limits<double>::infinity();            ///< what is below becomes this
  double most = std::numeric_limits<double>::infinity();  ///< what is above becomes this; >= least
  std::vector<Effect> effects = {};                       ///< they add up
};

/// Worlds without end: quantity q of world i is a function of the seed, i and q alone. It takes the numbers
/// 2q and 2q + 1 of sample i of CounterRandom: the first is the uniform one, both make a normal one (G. Box,
/// M. Muller, "A Note on the Generation of Random Normal Deviates", 1958). Borrows its arrays.
struct ScenarioSampler {
  std::uint64_t seed = 0;                         ///< of the generator
  std::vector<ScenarioQuantity> quantities = {};  ///< independent of each other
};

/// The number that this quantity, of this place in its sampler, has in a world.
[[nodiscard]] double scenario_draw(const ScenarioQuantity& quantity, std::uint64_t seed, std::int64_t world,
                                   std::uint32_t place);

/// Sets `sample` and `scenarios` of a problem that has its other parts. Errors: those of the problem, and
/// "samples.entries[2].positions", "samples.values" and such. An entry of a row of first-stage variables
/// alone that no own_… list names is refused.
[[nodiscard]] Expected<void> set_worlds(ScenarioProblem& problem, const ScenarioTable& table);
/// The same, of a sampler: "sampler.quantities[0].effects[1].gains" and such.
[[nodiscard]] Expected<void> set_worlds(ScenarioProblem& problem, const ScenarioSampler& sampler);

}  // namespace marble
