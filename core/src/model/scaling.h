// Provides equilibration and the solver's only copy of the problem's data.
//
// With z = D z̄, rows scaled by E and the cost by c, the scaled problem is
//   Q̄ = c D Q D, ḡ = c D g, Ā = E_A A D, b̄ = E_A b, and so on for the rows [C; L; R].
// A pair's two rows are scaled separately: s̄ t̄ = κ then relaxes s t to κ / (E_L E_R).
#pragma once

#include "marble/problem.h"
#include "model/interrupt.h"
#include "model/rows.h"

namespace marble {

/// Sizes of the scaled numbers: the largest entry of each row and column, and the cost.
struct ScaledSizes {
  Vector variable, equality, row;
  Vector columns;         ///< of the columns of Q alone; as gradient, of their last drift
  double hessian = 0.0;   ///< the mean of `columns`
  double gradient = 0.0;  ///< the largest entry of g
  double cost = 0.0;      ///< hessian or gradient, whichever is larger
};

/// With which a problem is scaled, as above.
struct ScaleFactors {
  Vector variable;  ///< D, n
  Vector equality;  ///< E_A, n_e
  Vector row;       ///< E of [C; L; R], n_i + 2 n_c
  double cost = 1.0;
};

struct ScaledProblem {
  SymmetricMatrix Q;
  RowMatrix A;
  RowMatrix rows;  ///< [C; L; R], numbered by `layout`
  Vector g, b;
  Vector offset;  ///< [d; l; r]
  RowLayout layout;
  double c0 = 0.0;          ///< the user's constant, unscaled
  double cost_scale = 1.0;  ///< c
  Vector variable_scale;    ///< D, n
  Vector equality_scale;    ///< E_A, n_e
  Vector row_scale;         ///< E of [C; L; R], n_i + 2 n_c
  ScaledSizes sizes;        ///< sizes of the numbers for which the scale factors were made

  [[nodiscard]] Index variables() const { return static_cast<Index>(g.size()); }
  [[nodiscard]] Index equalities() const { return static_cast<Index>(b.size()); }
  [[nodiscard]] Index inequalities() const { return layout.inequalities; }
  [[nodiscard]] Index pairs() const { return layout.pairs; }
  /// Converts an objective of this problem, without a constant, to the user's units.
  [[nodiscard]] double user_objective(double scaled) const { return scaled / cost_scale + c0; }
};

/// Equilibrates [Q Aᵀ Cᵀ Lᵀ Rᵀ; A; C; L; R] by Ruiz's method in the ∞-norm, `passes` times, then scales the
/// cost by 1 / max(mean column norm of Q̄, ‖ḡ‖∞). Zero rows and columns keep the scale 1. If interrupted, it
/// skips the remaining passes.
ScaledProblem scale(const Problem& problem, int passes, const Interrupt& interrupt = {});

/// Puts new numbers into the same pattern, with the existing scale factors, which are those of the first
/// problem. Returns true if a matrix changed.
bool rescale(const ProblemUpdate& update, ScaledProblem& problem);

/// If numbers have left the range for which the scale factors were made, by tuning::scale_drift, or the
/// factors now hide curvature that those of scale() would not, multiplies them by powers of two, which change
/// no bit of a mantissa. Returns true if it did: all results computed in scaled units are then invalid.
/// Checks the matrices only if they have changed.
bool refit_scaling(ScaledProblem& problem, int passes, bool matrices_changed);

}  // namespace marble
