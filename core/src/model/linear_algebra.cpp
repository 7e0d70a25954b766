#include "model/linear_algebra.h"

#include <numeric>

extern "C" void openblas_set_num_threads(int threads) __attribute__((weak));  // exists only in OpenBLAS

namespace marble {

// Runs once per process, because another solve may be inside BLAS already.
void keep_blas_to_one_thread() {
  [[maybe_unused]] static const bool done = [] {
    if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
    return true;
  }();
}

void append_rows(const SparseMatrixView& matrix, Index rows, RowMatrix& to) {
  const std::size_t entries = to.values.size() + matrix.values.size();
  const auto first = static_cast<std::size_t>(to.rows);
  to.rows += rows;
  to.row_pointers.resize(first + static_cast<std::size_t>(rows) + 1, 0);
  to.column_indices.resize(entries);
  to.values.resize(entries);
  to.source.resize(entries);
  for (const Index row : matrix.row_indices) ++to.row_pointers[first + static_cast<std::size_t>(row) + 1];
  const auto begin = to.row_pointers.begin() + static_cast<std::ptrdiff_t>(first);
  std::partial_sum(begin, to.row_pointers.end(), begin);
  if (matrix.values.empty()) return;
  std::vector<Index> next(begin, to.row_pointers.end() - 1);
  for (Index column = 0; column < to.columns; ++column) {
    for (Index k = matrix.column_pointers[column]; k < matrix.column_pointers[column + 1]; ++k) {
      const Index slot = next[matrix.row_indices[k]]++;
      to.column_indices[slot] = column;
      to.values[slot] = matrix.values[k];
      to.source[slot] = k;
    }
  }
}

void multiply(const RowMatrix& matrix, ConstVectorRef x, VectorRef out, Index first) {
  for (Index row = first; row < matrix.rows; ++row) {
    double sum = 0.0;
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      sum += matrix.values[k] * x[matrix.column_indices[k]];
    }
    out[row - first] = sum;
  }
}

void add_transposed(const RowMatrix& matrix, ConstVectorRef y, VectorRef out) {
  for (Index row = 0; row < matrix.rows; ++row) {
    const double scale = y[row];
    if (scale == 0.0) continue;
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      out[matrix.column_indices[k]] += scale * matrix.values[k];
    }
  }
}

SymmetricMatrix upper_triangle(const SparseMatrixView& matrix, Index size) {
  SymmetricMatrix result;
  result.size = size;
  result.column_pointers.assign(static_cast<std::size_t>(size) + 1, 0);
  if (matrix.values.empty()) return result;
  for (Index column = 0; column < size; ++column) {
    for (Index k = matrix.column_pointers[column]; k < matrix.column_pointers[column + 1]; ++k) {
      if (matrix.row_indices[k] > column) break;  // rows ascend: the rest is the mirror image
      result.row_indices.push_back(matrix.row_indices[k]);
      result.values.push_back(matrix.values[k]);
      result.source.push_back(k);
    }
    result.column_pointers[column + 1] = static_cast<Index>(result.values.size());
  }
  return result;
}

void multiply(const SymmetricMatrix& matrix, ConstVectorRef x, VectorRef out) {
  out.setZero();
  for (Index column = 0; column < matrix.size; ++column) {
    double sum = 0.0;
    for (Index k = matrix.column_pointers[column]; k < matrix.column_pointers[column + 1]; ++k) {
      const Index row = matrix.row_indices[k];
      const double value = matrix.values[k];
      sum += value * x[row];
      if (row != column) out[row] += value * x[column];
    }
    out[column] += sum;
  }
}

}  // namespace marble
