// Checks by enumeration that a conflict is one, and that it is minimal: shares no code with the solver.
#pragma once

#include <cstdint>

#include "marble/problem.h"
#include "marble/report/conflict.h"

namespace marble::testing {

/// Returns whether these parts of a problem have a common point: for each choice of zero sides, applies
/// brute_force() to the remaining rows. For conflicts of at most 12 complementarities.
[[nodiscard]] bool have_point(const ProblemView& problem, const Conflict& parts);

/// Returns whether the parts have a common point after removal of any one of them.
[[nodiscard]] bool is_irreducible(const ProblemView& problem, const Conflict& parts);

// Generates random LCQPs that are feasible except for a planted conflict.

/// The kind of a planted conflict.
enum class Plant {
  inequalities,  ///< whose sum is contradictory
  equalities,    ///< and an inequality, likewise
  sides,         ///< of pairs, and an inequality: independent of complementarity
  subset_sum,    ///< of pairs e ⊥ 1 − e, with an equality that no choice of sides satisfies
  subset_band,   ///< the same between two inequalities
  budgets,       ///< of pairs with e + f ≥ 1, and caps on Σ e and Σ f that no choice of sides satisfies
};
inline constexpr Plant kPlants[] = {Plant::inequalities, Plant::equalities,  Plant::sides,
                                    Plant::subset_sum,   Plant::subset_band, Plant::budgets};

/// Returns the same problem for the same seed on every machine: 4 to 15 pairs of up to 25 variables with
/// equalities and inequalities, feasible at a point that is drawn first; then the conflict, with 1 to 4
/// further pairs if it needs any, and all rows shuffled.
[[nodiscard]] OwnedProblem planted_conflict(Plant plant, std::uint64_t seed);

}  // namespace marble::testing
