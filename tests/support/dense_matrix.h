// Converts dense matrices, the easiest form for small problems, to the sparse ones of a problem.
#pragma once

#include <Eigen/Core>

#include "marble/problem.h"

namespace marble::testing {

/// Returns its nonzero entries.
[[nodiscard]] inline SparseMatrix sparse(const Eigen::MatrixXd& m) {
  Triplets entries;
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      if (m(i, j) != 0.0) entries.add(static_cast<Index>(i), static_cast<Index>(j), m(i, j));
    }
  }
  return compress(static_cast<Index>(m.rows()), static_cast<Index>(m.cols()), entries, "m").value();
}

}  // namespace marble::testing
