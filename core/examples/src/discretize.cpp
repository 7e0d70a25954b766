#include "discretize.h"

#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

namespace marble::examples {

Discrete zero_order_hold(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, double step_s) {
  // The exponential of [A B; 0 0]·h holds both parts.
  const Eigen::Index n = A.rows();
  const Eigen::Index m = B.cols();
  Eigen::MatrixXd block = Eigen::MatrixXd::Zero(n + m, n + m);
  block.topLeftCorner(n, n) = A * step_s;
  block.topRightCorner(n, m) = B * step_s;
  Eigen::MatrixXd exponential = block.exp();
  // Rounding would make structural zeros dense.
  exponential = exponential.unaryExpr([](double value) { return std::abs(value) < 1e-14 ? 0.0 : value; });
  return {exponential.topLeftCorner(n, n), exponential.topRightCorner(n, m)};
}

}  // namespace marble::examples
