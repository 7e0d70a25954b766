// What kind of stationary point a feasible point with its multipliers is.
#pragma once

#include <vector>

#include "data/residual.h"

namespace marble {

/// Pairs with both sides at zero (scaled, to 1e-8): only they tell the kinds apart.
[[nodiscard]] std::vector<Index> biactive_pairs(const Images& images);

/// The strongest kind whose sign conditions the multipliers ξ = −λ_L and η = −λ_R of the biactive pairs meet,
/// for a point that is feasible, with multipliers that are stationary and complementary. (Scheel and
/// Scholtes, "Mathematical programs with complementarity constraints", 2000.)
[[nodiscard]] Stationarity classify(const Images& images, const Iterate& x);

}  // namespace marble
