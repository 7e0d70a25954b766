// Dense matrices, in which small problems are easiest written down, as the sparse ones of a problem.
#pragma once

#include <Eigen/Core>

#include "marble/problem.h"

namespace marble::testing {

/// Its entries that are not 0.
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
