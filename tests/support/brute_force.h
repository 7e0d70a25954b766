// Finds the global optimum of a tiny LCQP by enumeration: shares no code with the solver.
#pragma once

#include <optional>
#include <vector>

#include "marble/problem.h"
#include "marble/solution.h"

namespace marble::testing {

struct GlobalOptimum {
  double objective = 0.0;  ///< −∞ if unbounded
  std::vector<double> z;   ///< a point that attains it, to about 1e-8; empty if unbounded
  int feasible_branches = 0;
  bool certain = true;  ///< the solve of each branch converged; if one did not, the optimum may be lower
};

/// Solves the convex QP of each of the 2^n_c choices of the zero side of each pair. For n_c <= 12 and a Q
/// that is convex on every branch; throws std::invalid_argument otherwise. Returns nothing if no branch is
/// feasible.
[[nodiscard]] std::optional<GlobalOptimum> brute_force(const ProblemView& problem);

/// Returns the status that a solver must report for a problem with this optimum.
[[nodiscard]] Status true_status(const std::optional<GlobalOptimum>& optimum);

}  // namespace marble::testing
