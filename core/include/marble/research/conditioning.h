// The condition number of the paper's KKT matrix along the path, by which its section IV.A compares
// retractions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "marble/options.h"
#include "marble/problem.h"
#include "marble/solver.h"

namespace marble {

/// One κ of a path, at the end of its inner loop.
struct PathCondition {
  double kappa = 0.0;      ///< κ there
  double condition = 0.0;  ///< of the whole ∇r in (13), with the path's scaling, in the 1-norm; estimated
  std::int32_t iterations = 0;  ///< Newton steps so far
};

/// A path and its condition numbers.
struct PathConditions {
  std::vector<PathCondition> at;  ///< decreasing κ, each except the last at most 0.7 times the one before
  Status status = Status::numerical_failure;  ///< how the path ended
  std::string detail;                         ///< the same in words
  std::int32_t iterations = 0;                ///< Newton steps in all
};

/// Follows the path from z = 0 with these options, without any later phase, and estimates the condition of ∇r
/// on the way. Each estimate takes a factorization of the whole ∇r: this is for studies, not for solves.
/// Errors: invalid_argument of the options; resource_exhausted if there is no linear system; cancelled.
[[nodiscard]] Expected<PathConditions> path_conditions(const Problem& problem, const Options& options,
                                                       const SolveControls& controls = {});

}  // namespace marble
