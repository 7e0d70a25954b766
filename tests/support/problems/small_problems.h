// Small LCQPs with known global optima.
#pragma once

#include <vector>

#include "marble/problem.h"

namespace marble::testing {

struct SmallProblem {
  OwnedProblem problem;
  double optimum;  ///< of the global solution
};

/// Some twenty-five: problems of the MacMPEC collection (S. Leyffer) in encodings of our own, and hand-made
/// ones for every missing block and for degenerate solutions. Built anew at each call.
[[nodiscard]] std::vector<SmallProblem> small_problems();

/// Thirty more: bilevel and equilibrium problems of the literature, sources at each, and single elements of
/// mechanics, circuits and choice. Up to 12 pairs.
[[nodiscard]] std::vector<SmallProblem> known_problems();

/// The public example of the paper's solver: min zᵀz, z₁ = 1, z₂ ≥ 1, 0 ≤ z₃ + 1 ⊥ z₄ − 1 ≥ 0; optimum 3.
[[nodiscard]] SmallProblem public_example();

/// A string under its weight above a hump: min ½ ∫ u'² + ∫ u, u ≥ ψ, by n linear elements. No pairs.
[[nodiscard]] OwnedProblem obstacle_problem(Index n);

}  // namespace marble::testing
