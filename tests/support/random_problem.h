// Generates random LCQPs from seeds, feasible by construction.
#pragma once

#include <cstdint>

#include "marble/problem.h"

namespace marble::testing {

struct RandomSizes {
  Index variables = 12;
  Index equalities = 3;
  Index inequalities = 5;
  Index pairs = 4;
  double density = 0.4;     ///< of every matrix
  bool indefinite = false;  ///< makes Q indefinite
};

/// Returns the same problem for the same seed on every machine. A point z* is drawn first, and offsets are
/// chosen such that it is feasible, with one or both sides of each pair zero.
[[nodiscard]] OwnedProblem random_problem(const RandomSizes& sizes, std::uint64_t seed);

/// Returns a strictly convex problem without constraints, with the upper triangle of a Hessian of three
/// scattered entries per column: a small request with much fill-in. 16,000 variables: 10⁷ entries, minutes of
/// factorization.
[[nodiscard]] OwnedProblem filling_problem(Index variables);

}  // namespace marble::testing
