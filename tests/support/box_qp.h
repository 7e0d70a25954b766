// Generates the optimality conditions of random nonconvex QPs over a box, as LCQPs.
#pragma once

#include <cstdint>

#include "marble/problem.h"

namespace marble::testing {

/// The conditions of min ½xᵀHx + cᵀx over 0 ≤ x ≤ 1 with a dense indefinite H: Hx + c − λ + μ = 0,
/// 0 ≤ x ⊥ λ ≥ 0 and 0 ≤ 1 − x ⊥ μ ≥ 0, in the variables (x, λ, μ). The cost ½(cᵀx − Σμ) is that of the QP at
/// each stationary point, so that the optimum is that of the QP. Its relaxation without the pairs' zeros is
/// unbounded. Entries of H and c are integers from −50 to 50; the same for the same seed on every machine.
[[nodiscard]] OwnedProblem box_qp(Index variables, std::uint64_t seed);

/// Returns the best of many descents on the QP itself, coordinate by coordinate from random points: an upper
/// bound on the optimum of box_qp(), which for a few variables is the optimum.
[[nodiscard]] double box_qp_descent(Index variables, std::uint64_t seed, int starts = 300);

}  // namespace marble::testing
