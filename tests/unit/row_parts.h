// The rows of a scaled problem by the matrix they came from.
#pragma once

#include "model/scaling.h"

namespace marble {

inline RowMatrix rows_from(const RowMatrix& matrix, Index first, Index count) {
  RowMatrix part;
  part.rows = count;
  part.columns = matrix.columns;
  const Index begin = matrix.row_pointers[first];
  const Index end = matrix.row_pointers[first + count];
  part.column_indices.assign(matrix.column_indices.begin() + begin, matrix.column_indices.begin() + end);
  part.values.assign(matrix.values.begin() + begin, matrix.values.begin() + end);
  for (Index row = 0; row < count; ++row)
    part.row_pointers.push_back(matrix.row_pointers[first + row + 1] - begin);
  return part;
}

inline RowMatrix C_of(const ScaledProblem& p) { return rows_from(p.rows, 0, p.inequalities()); }
inline RowMatrix L_of(const ScaledProblem& p) { return rows_from(p.rows, p.layout.s(0), p.pairs()); }
inline RowMatrix R_of(const ScaledProblem& p) { return rows_from(p.rows, p.layout.t(0), p.pairs()); }
inline Vector d_of(const ScaledProblem& p) { return p.layout.inequality_part(p.offset); }
inline Vector l_of(const ScaledProblem& p) { return p.layout.s_part(p.offset); }
inline Vector r_of(const ScaledProblem& p) { return p.layout.t_part(p.offset); }
inline Vector inequality_scale_of(const ScaledProblem& p) { return p.layout.inequality_part(p.row_scale); }
inline Vector left_scale_of(const ScaledProblem& p) { return p.layout.s_part(p.row_scale); }
inline Vector right_scale_of(const ScaledProblem& p) { return p.layout.t_part(p.row_scale); }

}  // namespace marble
