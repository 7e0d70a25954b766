// How well conditioned the paper's KKT matrix is along the path: what its section IV.A compares retractions
// by.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "marble/options.h"
#include "marble/problem.h"
#include "marble/solver.h"

namespace marble {

/// One κ of a path, where its inner loop has ended.
struct PathCondition {
  double kappa = 0.0;      ///< κ there
  double condition = 0.0;  ///< of ∇r in (13), whole and scaled as the path has it, in the 1-norm; estimated
  std::int32_t iterations = 0;  ///< Newton steps up to there
};

/// A path, and what was seen along it.
struct PathConditions {
  std::vector<PathCondition> at;              ///< κ falling, each but the last at most 0.7 of the one before
  Status status = Status::numerical_failure;  ///< how the path ended
  std::string detail;                         ///< the same in words
  std::int32_t iterations = 0;                ///< Newton steps in all
};

/// Follows the path from z = 0 by these options, without anything after it, and looks at ∇r on the way. A
/// condition is found by a factorization of the whole of ∇r: to study solvers, not to solve. Errors:
/// invalid_argument of the options; resource_exhausted where there is no linear system; cancelled.
[[nodiscard]] Expected<PathConditions> path_conditions(const Problem& problem, const Options& options,
                                                       const SolveControls& controls = {});

}  // namespace marble
