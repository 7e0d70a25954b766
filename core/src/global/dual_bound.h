// Rigorous bounds: what multipliers prove about a convex relaxation, with an allowance for rounding.
//
// For a convex Q, any point z̄ and any multipliers with the right signs, every feasible z satisfies
//
//   f(z) ≥ −½ z̄ᵀQz̄ + bᵀy − oᵀμ + rᵀz,   r = Q z̄ + g + Aᵀy − Jᵀμ,
//
// with rows A z + b = 0 and J z + o ≥ 0 (= 0 where μ may be negative). The term with r is charged at the
// worst z within the bounds of z that the rows imply. Where they imply none, r must be 0 to 1e-9 of the
// largest sum from which it is made, and is charged up to a stated radius.
#pragma once

#include <algorithm>
#include <vector>

#include "model/careful_sum.h"
#include "model/scaling.h"
#include "model/tuning.h"

namespace marble {

/// Returns how far out, in user units, bounds of a tree that starts from z hold where no row bounds a
/// variable.
[[nodiscard]] double reach_from(const ScaledProblem& problem, ConstVectorRef z);

/// Bounds of z, scaled.
struct Box {
  /// Computes the bounds that the rows imply, each with the bounds of its other variables, in this number of
  /// passes; |z|∞ ≤ far (user units) where they imply none.
  Box(const ScaledProblem& problem, double far, int passes = tuning::few_passes);
  Vector lower, upper;  ///< ±∞ where rows imply none
  Vector radius;        ///< for those variables
  /// Adds bounds that are known from elsewhere.
  void intersect(const Vector& least, const Vector& most) {
    lower = lower.cwiseMax(least);
    upper = upper.cwiseMin(most);
  }
  /// True if rows bound every variable, so that bounds in the box hold everywhere.
  [[nodiscard]] bool is_bounded() const { return lower.allFinite() && upper.allFinite(); }

 private:
  void tighten(const RowMatrix& matrix, const Vector& offset, bool equality);
};

/// Gives multipliers the signs that a relaxation requires: negative ones of rows that are not fixed become 0.
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

  /// Returns a bound of the objective (scaled, without constant) over the box. Multipliers must have the
  /// right signs.
  [[nodiscard]] double of_objective(const Box& box, ConstVectorRef z, ConstVectorRef y, ConstVectorRef mu);
  /// Returns how much of that bound was lost on r.
  [[nodiscard]] double paid() const { return paid_; }
  /// True if the multipliers contradict the rows: with Q = 0 and g = 0 their bound is above 0 (Farkas). Where
  /// nothing bounds z, r must be rounding: an r of 1e-10 of the gap means a solution at 1e10.
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
