// Random LCQPs by seed, feasible by construction.
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

/// The same problem for the same seed on every machine. A point z* is drawn first and offsets are chosen so
/// that it is feasible, each pair with one or both sides zero.
[[nodiscard]] OwnedProblem random_problem(const RandomSizes& sizes, std::uint64_t seed);

/// Strictly convex and without constraints, but with the upper triangle of a Hessian of three scattered
/// entries a column: a small request whose factor fills in. 16,000 variables: 10⁷ entries, minutes of
/// factorization.
[[nodiscard]] OwnedProblem filling_problem(Index variables);

}  // namespace marble::testing
