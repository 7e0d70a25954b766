// Provides products of vectors and of sparse matrices stored by columns.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "marble/problem.h"

namespace marble::nonlinear {

inline double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

inline double largest(std::span<const double> values) {
  double most = 0.0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

/// y += M x
inline void add_product(const SparseMatrix& M, std::span<const double> x, std::span<double> y) {
  for (Index j = 0; j < M.columns; ++j) {
    for (Index k = M.column_pointers[j]; k < M.column_pointers[j + 1]; ++k)
      y[M.row_indices[k]] += M.values[k] * x[j];
  }
}

/// y += a Mᵀ x
inline void add_transposed(const SparseMatrix& M, std::span<const double> x, double a, std::span<double> y) {
  for (Index j = 0; j < M.columns; ++j) {
    double sum = 0.0;
    for (Index k = M.column_pointers[j]; k < M.column_pointers[j + 1]; ++k)
      sum += M.values[k] * x[M.row_indices[k]];
    y[j] += a * sum;
  }
}

/// xᵀ B x, from B's upper triangle
inline double quadratic(const SparseMatrix& upper, std::span<const double> x) {
  double sum = 0.0;
  for (Index j = 0; j < upper.columns; ++j) {
    for (Index k = upper.column_pointers[j]; k < upper.column_pointers[j + 1]; ++k) {
      const Index i = upper.row_indices[k];
      sum += (i == j ? 1.0 : 2.0) * upper.values[k] * x[i] * x[j];
    }
  }
  return sum;
}

}  // namespace marble::nonlinear
