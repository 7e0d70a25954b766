// Provides the few sparse products that the solver needs, on matrices stored by rows.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "marble/problem.h"

namespace marble {

using Vector = Eigen::VectorXd;
using VectorRef = Eigen::Ref<Vector>;
using ConstVectorRef = const Eigen::Ref<const Vector>&;

/// A sparse matrix in compressed row form: one row is one constraint.
struct RowMatrix {
  Index rows = 0;
  Index columns = 0;
  std::vector<Index> row_pointers{0};
  std::vector<Index> column_indices;
  std::vector<double> values;
  std::vector<Index> source;  ///< position of each entry in the column-compressed original

  [[nodiscard]] Index row_size(Index row) const { return row_pointers[row + 1] - row_pointers[row]; }
};

/// Appends the rows of a column-compressed matrix; O(entries).
void append_rows(const SparseMatrixView& matrix, Index rows, RowMatrix& to);

/// out = M x, for the rows from `first` on.
void multiply(const RowMatrix& matrix, ConstVectorRef x, VectorRef out, Index first = 0);
/// Returns row i of M times x; add_row() adds a times row i to `to`. Both work on Lanes too.
template <class T>
T row_product(const RowMatrix& matrix, Index row, const T* x) {
  T sum{};
  for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k)
    sum += matrix.values[k] * x[matrix.column_indices[k]];
  return sum;
}
template <class T>
void add_row(const RowMatrix& matrix, Index row, const T& a, T* to) {
  for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k)
    to[matrix.column_indices[k]] += matrix.values[k] * a;
}
/// out += Mᵀ y
void add_transposed(const RowMatrix& matrix, ConstVectorRef y, VectorRef out);

/// A symmetric matrix, given by its upper triangle compressed by columns.
struct SymmetricMatrix {
  Index size = 0;
  std::vector<Index> column_pointers{0};
  std::vector<Index> row_indices;
  std::vector<double> values;
  std::vector<Index> source;  ///< position of each entry in the original
};

/// Returns the upper triangle of Q in either form of the Hessian; O(entries).
SymmetricMatrix upper_triangle(const SparseMatrixView& matrix, Index size);

/// out = M x
void multiply(const SymmetricMatrix& matrix, ConstVectorRef x, VectorRef out);

/// Prevents BLAS's own threads from competing with the caller's and changing the order of sums.
void keep_blas_to_one_thread();

/// max |x_i|, 0 for an empty vector, NaN if any entry is NaN.
inline double max_abs(ConstVectorRef x) {
  return x.size() == 0 ? 0.0 : x.cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
}

}  // namespace marble
