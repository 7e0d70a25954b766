// Measures a point by plain loops over the user's own data: for any solver, and without relying on its
// report.
#pragma once

#include <span>

#include "marble/problem.h"

namespace marble::cli {

/// The measure of a pair's distance from complementarity.
enum class PairMeasure {
  smaller_side,  ///< |min(s, t)|
  product,       ///< |s·t|, as the paper's authors use: s = t = 10⁻³ counts as complementary to 10⁻⁶
};

/// Measures of a point z, with s = L z + l and t = R z + r; all in the user's units.
struct Measures {
  double objective = 0.0;     ///< ½zᵀQz + gᵀz + c₀
  double equality = 0.0;      ///< max |A z + b|
  double inequality = 0.0;    ///< max −(C z + d), −s, −t; at least 0
  double smaller_side = 0.0;  ///< max |min(s, t)|
  double product = 0.0;       ///< max |s·t|; NaN if unknown

  /// Returns true if no measure exceeds `tolerance`. If the product is unknown the smaller side is used.
  [[nodiscard]] bool feasible(double tolerance, PairMeasure pairs) const;
};

/// Measures z, which must have one number per variable.
[[nodiscard]] Measures measure(const OwnedProblem& problem, std::span<const double> z);

}  // namespace marble::cli
