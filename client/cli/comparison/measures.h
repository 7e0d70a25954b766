// What a point is worth, by plain loops over the user's own data: of any solver's, and no solver's word for
// it.
#pragma once

#include <span>

#include "marble/problem.h"

namespace marble::cli {

/// How far a pair is from being complementary.
enum class PairMeasure {
  smaller_side,  ///< |min(s, t)|
  product,       ///< |s·t|, as the paper's authors do: s = t = 10⁻³ is complementary to 10⁻⁶ by it
};

/// Of a point z, with s = L z + l and t = R z + r; all in the user's units.
struct Measures {
  double objective = 0.0;     ///< ½zᵀQz + gᵀz + c₀
  double equality = 0.0;      ///< max |A z + b|
  double inequality = 0.0;    ///< max −(C z + d), −s, −t; at least 0
  double smaller_side = 0.0;  ///< max |min(s, t)|
  double product = 0.0;       ///< max |s·t|; NaN if it is not known

  /// Whether nothing is larger than `tolerance`. Where the product is not known the smaller side counts.
  [[nodiscard]] bool feasible(double tolerance, PairMeasure pairs) const;
};

/// z must have a number a variable.
[[nodiscard]] Measures measure(const OwnedProblem& problem, std::span<const double> z);

}  // namespace marble::cli
