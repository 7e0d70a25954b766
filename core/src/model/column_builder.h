// Builds a sparse matrix column by column.
#pragma once

#include <cstddef>
#include <utility>

#include "marble/problem.h"
#include "model/entries.h"

namespace marble {

/// A matrix that grows by columns. The rows of a column are added in ascending order.
class ColumnBuilder {
 public:
  /// For `rows` rows, and memory for so many columns and entries.
  explicit ColumnBuilder(Index rows = 0, std::size_t columns = 0, std::size_t entries = 0) {
    matrix_.rows = rows;
    matrix_.column_pointers.reserve(columns + 1);
    matrix_.column_pointers.push_back(0);
    matrix_.row_indices.reserve(entries);
    matrix_.values.reserve(entries);
  }

  /// Returns the entry's position.
  std::size_t add(Index row, double value) {
    matrix_.row_indices.push_back(row);
    matrix_.values.push_back(value);
    return matrix_.values.size() - 1;
  }
  /// Adds `count` zeros, from row `first` on.
  void add_zeros(Index first, Index count) {
    for (Index i = 0; i < count; ++i) add(first + i, 0.0);
  }
  /// Adds column j of `m`, its row 0 in row `first`.
  void add_column(const SparseMatrixView& m, Index j, Index first = 0) {
    for_column(m, j, [&](Index row, double value) { add(first + row, value); });
  }
  void end_column() {
    ++matrix_.columns;
    matrix_.column_pointers.push_back(static_cast<Index>(matrix_.values.size()));
  }

  void add_rows(Index rows) { matrix_.rows += rows; }
  [[nodiscard]] Index rows() const { return matrix_.rows; }
  /// Returns the matrix, empty if it has no rows.
  [[nodiscard]] SparseMatrix take() { return matrix_.rows == 0 ? SparseMatrix{} : std::move(matrix_); }

 private:
  SparseMatrix matrix_{0, 0, {}, {}, {}};
};

}  // namespace marble
