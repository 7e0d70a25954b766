// Provides small LCQPs with known global optima.
#pragma once

#include <string_view>
#include <vector>

#include "marble/problem.h"

namespace marble::testing {

struct SmallProblem {
  OwnedProblem problem;
  double optimum;  ///< of the global solution
};

/// Returns about twenty-five problems: of MacMPEC, and hand-made ones for every missing block and for
/// degenerate solutions. Built anew at each call.
[[nodiscard]] std::vector<SmallProblem> small_problems();

/// Returns thirty more: bilevel and equilibrium problems of the literature, each with its source, and single
/// elements of mechanics, circuits and choice. Up to 12 pairs.
[[nodiscard]] std::vector<SmallProblem> known_problems();

/// Returns the problem of MacMPEC of that name, which must exist, without its starting point.
[[nodiscard]] SmallProblem of_macmpec(std::string_view name);

/// Returns the public example of the paper's solver: min zᵀz, z₁ = 1, z₂ ≥ 1, 0 ≤ z₃ + 1 ⊥ z₄ − 1 ≥ 0;
/// optimum 3.
[[nodiscard]] SmallProblem public_example();

/// Returns a string under its weight above a hump: min ½ ∫ u'² + ∫ u, u ≥ ψ, with n linear elements. No
/// pairs.
[[nodiscard]] OwnedProblem obstacle_problem(Index n);

}  // namespace marble::testing
