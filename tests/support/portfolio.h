// Generates random portfolios with a limit on the number of assets, as LCQPs.
#pragma once

#include <cstdint>

#include "marble/problem.h"

namespace marble::testing {

/// min 100 (xᵀSx − ½ mᵀx) with Σ x = 1 and at most `most` positive x ≥ 0, where S is a factor model's
/// covariance: 0 ≤ x ⊥ y ≥ 0, y ≤ 1, Σ y ≥ assets − most, in the variables (x, y) (Burdakov, Kanzow and
/// Schwartz 2016). A pair can only switch together with another one. The same for the same seed on every
/// machine.
[[nodiscard]] OwnedProblem portfolio(Index assets, Index most, std::uint64_t seed);

/// Returns the optimum of portfolio(), by enumeration of all sets of assets.
[[nodiscard]] double best_portfolio(Index assets, Index most, std::uint64_t seed);

}  // namespace marble::testing
