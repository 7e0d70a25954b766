// Classifies a feasible point with multipliers as a kind of stationary point.
#pragma once

#include <vector>

#include "model/residual.h"

namespace marble {

/// Returns the pairs with both sides at zero (scaled, to 1e-8). Only these pairs distinguish the kinds.
[[nodiscard]] std::vector<Index> biactive_pairs(const Images& images);

/// Returns the strongest kind whose sign conditions are met by the multipliers ξ = −λ_L and η = −λ_R of the
/// biactive pairs. The point must be feasible, with multipliers that are stationary and complementary.
/// (Scheel and Scholtes, "Mathematical programs with complementarity constraints", 2000.)
[[nodiscard]] Stationarity classify(const Images& images, const Iterate& x);

}  // namespace marble
