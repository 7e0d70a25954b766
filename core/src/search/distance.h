// A problem's rows and pairs without its objective.
#pragma once

#include "proof/row_problem.h"

namespace marble {

/// Returns the problem with the objective ½|z − target|² and target 0; −target is its g. Scaled, except for
/// its units.
[[nodiscard]] inline ScaledProblem distance_problem(const ScaledProblem& p) {
  ScaledProblem distance = p;
  distance.Q = identity(p.variables());
  distance.g.setZero();
  return distance;
}

/// Returns a scaled problem without an objective in the user's units.
[[nodiscard]] inline ScaledProblem in_user_units(ScaledProblem p) {
  const auto unscale = [&p](RowMatrix& matrix, Vector& offset, Vector& scale) {
    for (Index row = 0; row < matrix.rows; ++row) {
      for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k)
        matrix.values[k] /= scale[row] * p.variable_scale[matrix.column_indices[k]];
    }
    offset.array() /= scale.array();
    scale.setOnes();
  };
  unscale(p.A, p.b, p.equality_scale);
  unscale(p.rows, p.offset, p.row_scale);
  p.variable_scale.setOnes();
  return p;
}

}  // namespace marble
