#include "support/dense_algebra.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace marble::testing {

Eigen::VectorXd dense_solve(const Eigen::MatrixXd& m, const Eigen::VectorXd& right) {
  return m.fullPivLu().solve(right);
}

Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace marble::testing
