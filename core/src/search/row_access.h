// Provides equalities and rows [C; L; R] under one numbering, for dense methods: row i < n_e is equality i,
// row n_e + i is row i of [C; L; R].
#pragma once

#include <cmath>

#include "model/careful_sum.h"
#include "model/scaling.h"

namespace marble {

class RowAccess {
 public:
  explicit RowAccess(const ScaledProblem& problem) : problem_(problem) {}

  [[nodiscard]] Index size() const { return problem_.equalities() + problem_.layout.size(); }
  [[nodiscard]] Index first_row() const { return problem_.equalities(); }
  [[nodiscard]] bool is_equality(Index row) const { return row < problem_.equalities(); }
  [[nodiscard]] double offset(Index row) const {
    return is_equality(row) ? problem_.b[row] : problem_.offset[row - first_row()];
  }
  /// Calls visit(column, value) for each entry of a row.
  template <class Visit>
  void for_each_entry(Index row, Visit&& visit) const {
    const RowMatrix& matrix = is_equality(row) ? problem_.A : problem_.rows;
    const Index at = is_equality(row) ? row : row - first_row();
    for (Index k = matrix.row_pointers[at]; k < matrix.row_pointers[at + 1]; ++k)
      visit(matrix.column_indices[k], matrix.values[k]);
  }
  void copy(Index row, VectorRef to) const {
    to.setZero();
    for_each_entry(row, [&](Index column, double value) { to[column] = value; });
  }
  /// The value of a row at z as if in twice the precision, and the size of the terms of its sum.
  struct Value {
    double value, size;
  };
  [[nodiscard]] Value value(Index row, ConstVectorRef z) const {
    CarefulSum sum;
    double size = std::abs(offset(row));
    sum.add(offset(row), 1.0);
    for_each_entry(row, [&](Index column, double value) {
      sum.add(value, z[column]);
      size += std::abs(value * z[column]);
    });
    return {sum.value(), size};
  }

 private:
  const ScaledProblem& problem_;
};

}  // namespace marble
