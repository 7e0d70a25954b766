// Generates linear complementarity problems that have a solution and nearly singular matrices.
#pragma once

#include <cstdint>

#include "marble/problem.h"

namespace marble::testing {

/// 0 ≤ z ⊥ M z + q ≥ 0 with 2 to 10 pairs, without a cost: M is symmetric and positive definite with
/// eigenvalues from 1 down to `smallest`. q is made from a solution with entries of up to 1, about half of
/// them 0, or with `far` its entries are drawn from [−1, 1): then a solution may be as large as 1/`smallest`.
/// A positive definite M has exactly one solution for every q. The same for the same seed on every machine.
[[nodiscard]] OwnedProblem ill_conditioned_lcp(double smallest, std::uint64_t seed, bool far);

/// Returns the contact forces of one step of `gravity_step`, as an LCP, for a stack of two boxes with masses
/// 1 and `ratio` on the ground, without a cost.
[[nodiscard]] OwnedProblem stacked_boxes(double ratio, double gravity_step = 0.00981);

}  // namespace marble::testing
