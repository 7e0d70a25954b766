// Random LCQPs that are feasible but for a planted conflict.
#pragma once

#include <cstdint>

#include "marble/problem.h"

namespace marble::testing {

/// What a conflict is planted of.
enum class Plant {
  inequalities,  ///< that add up to less than nothing
  equalities,    ///< and an inequality, likewise
  sides,         ///< of pairs, and an inequality: whatever complements what
  subset_sum,    ///< of pairs e ⊥ 1 − e, with an equality that no choice of sides meets
  subset_band,   ///< the same between two inequalities
  budgets,       ///< of pairs with e + f ≥ 1, and caps on Σ e and Σ f that no choice of sides meets
};
inline constexpr Plant kPlants[] = {Plant::inequalities, Plant::equalities,  Plant::sides,
                                    Plant::subset_sum,   Plant::subset_band, Plant::budgets};

/// The same problem for the same seed on every machine: 4 to 15 pairs of up to 25 variables with equalities
/// and inequalities, feasible at a point that is drawn first; then the plant, of 1 to 4 of further pairs
/// where it needs any, and all rows in another order.
[[nodiscard]] OwnedProblem planted_conflict(Plant plant, std::uint64_t seed);

}  // namespace marble::testing
