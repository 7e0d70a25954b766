// Generates random LCQPs of small integers from seeds: their branches can be enumerated, and ties are exact.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "marble/problem.h"

namespace marble::testing {

enum class IntegerFamily {
  convex,      ///< Q positive semidefinite, mostly definite; feasible
  singular,    ///< Q of low rank; feasible
  linear,      ///< Q = 0; feasible, often unbounded
  degenerate,  ///< most rows that could be inactive are active; Q of low rank or 0; feasible
  repeated,    ///< equalities, inequalities and pairs repeated, or multiples of each other; feasible
  equalities,  ///< more equalities than half the number of variables; feasible
  any,         ///< independent offsets: often infeasible
};
inline constexpr std::array kIntegerFamilies{
    IntegerFamily::convex,   IntegerFamily::singular,   IntegerFamily::linear, IntegerFamily::degenerate,
    IntegerFamily::repeated, IntegerFamily::equalities, IntegerFamily::any};

[[nodiscard]] std::string_view name(IntegerFamily family);

/// Returns a problem with 1 to `most_pairs` pairs and up to 8 variables; Q is convex. The same problem for
/// the same seed on every machine.
[[nodiscard]] OwnedProblem integer_problem(IntegerFamily family, std::uint64_t seed, Index most_pairs = 12);

}  // namespace marble::testing
