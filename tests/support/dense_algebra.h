// Provides the tests' operations on dense matrices, compiled once: Eigen's decompositions take 10 s each to
// compile.
#pragma once

#include <Eigen/Core>

namespace marble::testing {

/// Returns x with m x = right, by a rank-revealing LU. m: square, of full rank.
[[nodiscard]] Eigen::VectorXd dense_solve(const Eigen::MatrixXd& m, const Eigen::VectorXd& right);

/// Returns the eigenvalues of a symmetric matrix, the smallest first.
[[nodiscard]] Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& symmetric);

}  // namespace marble::testing
