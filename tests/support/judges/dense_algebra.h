// What the tests ask of dense matrices, compiled once: Eigen's decompositions take a compiler 10 s each.
#pragma once

#include <Eigen/Core>

namespace marble::testing {

/// x with m x = right, by a rank-revealing LU. m: square, of full rank.
[[nodiscard]] Eigen::VectorXd dense_solve(const Eigen::MatrixXd& m, const Eigen::VectorXd& right);

/// Those of a symmetric matrix, the smallest first.
[[nodiscard]] Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& symmetric);

}  // namespace marble::testing
