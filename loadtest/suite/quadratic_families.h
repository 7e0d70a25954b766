// Generates convex QPs without pairs from seeds.
#pragma once

#include <cstdint>

#include "marble/problem.h"

namespace marble::suite {

enum class Curvature { singular, strict, diagonal };

/// n/5 equalities, n inequalities, half of which are active at a point within the box |z| ≤ 2.
[[nodiscard]] OwnedProblem scattered_problem(Index n, Curvature curvature, std::uint64_t seed);

/// A mass in the plane, 4 states and 2 forces per step, moved to the origin from afar: forces and speeds are
/// bounded.
[[nodiscard]] OwnedProblem mpc_problem(Index steps, std::uint64_t seed);

}  // namespace marble::suite
