// A problem as dense matrices, with the rows of an answer.
#pragma once

#include <Eigen/Core>

#include "marble/problem.h"

namespace marble::fuzz {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

[[nodiscard]] inline Matrix dense(const SparseMatrixView& m, Eigen::Index rows, Eigen::Index columns,
                                  std::span<const double> values) {
  Matrix out = Matrix::Zero(rows, columns);
  for (Eigen::Index j = 0; j < columns && !values.empty(); ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      out(m.row_indices[k], j) = values[k];
  }
  return out;
}

[[nodiscard]] inline Vector dense(std::span<const double> v) {
  return Eigen::Map<const Vector>(v.data(), static_cast<Eigen::Index>(v.size()));
}

/// Of the upper entries; `values` may be others than the problem's own, such as a direction.
[[nodiscard]] inline Matrix dense_hessian(const ProblemView& p, std::span<const double> values) {
  const auto n = static_cast<Eigen::Index>(p.g.size());
  const Matrix Q = dense(p.Q, n, n, values);
  return Q.selfadjointView<Eigen::Upper>();
}

}  // namespace marble::fuzz
