// The memory that a solver needs regardless of its factorization.
#pragma once

#include "marble/options.h"

namespace marble {

class ReferenceMethods;

/// The sizes on which the estimate depends. They are doubles, so that no product of sizes overflows.
struct SolverSizes {
  double variables = 0.0, equalities = 0.0, inequalities = 0.0, pairs = 0.0;
  double entries = 0.0;  ///< of all five matrices
};

/// Returns the bytes of the scaled copy, of the engines' vectors and of the responses that a local search
/// keeps, with those of further starts. If this alone exceeds the limit, Solver::create refuses the problem
/// before it allocates anything. `methods` is needed where option `method` is one of them.
[[nodiscard]] double least_solver_bytes(const SolverSizes& sizes, const Options& options,
                                        const ReferenceMethods* methods = nullptr);

}  // namespace marble
