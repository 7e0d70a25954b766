// The memory that a solver needs whatever its factorization turns out to be.
#pragma once

#include "marble/options.h"

namespace marble {

/// What the estimate depends on. As numbers of type double, so that no product of sizes overflows.
struct SolverSizes {
  double variables = 0.0, equalities = 0.0, inequalities = 0.0, pairs = 0.0;
  double entries = 0.0;  ///< of all five matrices
};

/// Bytes of the scaled copy, of the engines' vectors and of the responses that a local search keeps, with
/// those of further starts. Solver::create refuses a problem for which this alone is too much before it
/// allocates anything.
[[nodiscard]] double least_solver_bytes(const SolverSizes& sizes, const Options& options);

}  // namespace marble
