// Makes the scenarios of a scenario solve from their differences: a table of numbers, or counter-based random
// numbers.
//
//   marble::ScenarioProblem problem{.base = base.view(), .first_stage = plan};
//   auto set = marble::set_scenarios(problem, marble::ScenarioSampler{.seed = 7, .quantities = {friction}});
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "marble/composite/scenarios.h"

namespace marble {

/// A part of a problem, by its numbers; for a matrix, its stored entries. In the order of ScenarioNumbers.
enum class ProblemPart { c0, g, b, d, l, r, Q, A, C, L, R };

/// Entries of one part of the base problem.
struct ScenarioEntries {
  ProblemPart part = ProblemPart::c0;     ///< the part
  std::span<const Index> positions = {};  ///< ascending; empty: all. For a full Q, only upper ones are used
};

/// The differences between scenarios. Borrows its arrays.
struct ScenarioTable {
  std::vector<ScenarioEntries> entries = {};  ///< the table's columns, in this order; no entry twice
  std::span<const double> values = {};        ///< one row for each scenario: the numbers of all these entries
  std::span<const double> weights = {};       ///< > 0, one for each scenario; empty: all equal
};

/// The distribution of a random number.
enum class ScenarioDistribution {
  uniform,    ///< in [location, location + scale)
  normal,     ///< location + scale · standard normal
  lognormal,  ///< exp(location + scale · standard normal)
};

/// A number that is drawn once for each scenario, and its effects.
struct ScenarioQuantity {
  /// Entries equal to those of the base plus the number times their gains.
  struct Effect {
    ScenarioEntries entries = {};        ///< the entries
    std::span<const double> gains = {};  ///< one for each entry, or one for all
  };
  ScenarioDistribution distribution = ScenarioDistribution::uniform;  ///< distribution of the number
  double location = 0.0;                                              ///< finite; see ScenarioDistribution
  double scale = 1.0;                                                 ///< finite, >= 0
  double least = -std::numeric_limits<double>::infinity();            ///< lower bound: the number is clamped
  double most = std::numeric_limits<double>::infinity();              ///< upper bound, likewise; >= least
  std::vector<Effect> effects = {};                                   ///< they add up
};

/// An infinite set of scenarios: quantity q of scenario i is a function of the seed, i and q only. It uses
/// the numbers 2q and 2q + 1 of sample i of CounterRandom: the first is the uniform number, both together
/// give a normal one (G. Box, M. Muller, "A Note on the Generation of Random Normal Deviates", 1958). Borrows
/// its arrays.
struct ScenarioSampler {
  std::uint64_t seed = 0;                         ///< seed of the generator
  std::vector<ScenarioQuantity> quantities = {};  ///< independent of each other
};

/// Returns the number of this quantity, at position `place` of its sampler, in a scenario.
[[nodiscard]] double scenario_draw(const ScenarioQuantity& quantity, std::uint64_t seed,
                                   std::int64_t scenario, std::uint32_t place);

/// Sets `sample` and `scenarios` of a problem whose other parts are set. Errors: those of the problem, and
/// "samples.entries[2].positions", "samples.values", …. An entry in a row of first-stage variables alone is
/// refused unless an own_… list names the row.
[[nodiscard]] Expected<void> set_scenarios(ScenarioProblem& problem, const ScenarioTable& table);
/// The same for a sampler. Errors: "sampler.quantities[0].effects[1].gains", ….
[[nodiscard]] Expected<void> set_scenarios(ScenarioProblem& problem, const ScenarioSampler& sampler);

}  // namespace marble
