// Bounds that are true: what multipliers prove of a convex relaxation, rounding paid for.
//
// For a convex Q, any point z̄ and any multipliers with the right signs every feasible z has
//
//   f(z) ≥ −½ z̄ᵀQz̄ + bᵀy − oᵀμ + rᵀz,   r = Q z̄ + g + Aᵀy − Jᵀμ,
//
// with rows A z + b = 0 and J z + o ≥ 0 (= 0 where μ may be negative). What is left of r is paid for at the
// worst z: within the bounds of z that the rows imply; where there are none r must be 0 to 1e-9 of the
// largest sum it is made of, and is paid for up to a stated radius.
#pragma once

#include <algorithm>
#include <vector>

#include "data/careful_sum.h"
#include "data/scaling.h"
#include "tuning.h"

namespace marble {

/// Where z lies, scaled.
struct Box {
  /// What the rows imply, each with the bounds of its other variables, in so many passes; and |z|∞ ≤ far
  /// (user units) where they do not.
  Box(const ScaledProblem& problem, double far, int passes = tuning::box_passes);
  Vector lower, upper;  ///< ±∞ where rows do not say
  Vector radius;        ///< for the others
  /// Whether rows bound every variable: what holds in it holds everywhere.
  [[nodiscard]] bool is_bounded() const { return lower.allFinite() && upper.allFinite(); }

 private:
  void tighten(const RowMatrix& matrix, const Vector& offset, bool equality);
};

/// `multipliers` with the signs that a relaxation asks for: 0 for what is negative of a row that is not
/// fixed.
template <class IsFixed>
void take_signs(const Vector& multipliers, const IsFixed& is_fixed, Vector& signed_multipliers) {
  signed_multipliers = multipliers;
  for (Index row = 0; row < signed_multipliers.size(); ++row) {
    if (!is_fixed(row)) signed_multipliers[row] = std::max(signed_multipliers[row], 0.0);
  }
}

class DualBound {
 public:
  explicit DualBound(const ScaledProblem& problem);

  /// Of the objective (scaled, without constant) over the box. Multipliers must have the right signs.
  [[nodiscard]] double of_objective(const Box& box, ConstVectorRef z, ConstVectorRef y, ConstVectorRef mu);
  /// How much of that bound was lost on r.
  [[nodiscard]] double paid() const { return paid_; }
  /// Whether the multipliers contradict the rows: with Q = 0 and g = 0 their bound is above 0 (Farkas). Where
  /// nothing bounds z, r is no more than rounding: what is 1e-10 of the gap is a solution at 1e10.
  [[nodiscard]] bool contradicts(const Box& box, ConstVectorRef y, ConstVectorRef mu);

 private:
  void add_rows(ConstVectorRef y, ConstVectorRef mu);
  [[nodiscard]] double settle(const Box& box, double negligible);

  const ScaledProblem& problem_;
  std::vector<CarefulSum> residual_;
  CarefulSum value_;
  double paid_ = 0.0;
};

}  // namespace marble
