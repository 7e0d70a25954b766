#include "discretize.h"

#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

namespace marble::examples {

void add_step(Model& model, const Discrete& step, Index next_state, Index state, Index input) {
  const auto states = static_cast<Index>(step.state.cols());
  const auto inputs = static_cast<Index>(step.input.cols());
  for (Index i = 0; i < states; ++i) {
    Terms terms = {{next_state + i, -1.0}};
    for (Index j = 0; j < states; ++j) terms.push_back({state + j, step.state(i, j)});
    for (Index j = 0; j < inputs; ++j) terms.push_back({input + j, step.input(i, j)});
    model.equal_zero(terms);
  }
}

Discrete zero_order_hold(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, double step_s) {
  // The exponential of [A B; 0 0]·h contains both parts.
  const Eigen::Index n = A.rows();
  const Eigen::Index m = B.cols();
  Eigen::MatrixXd block = Eigen::MatrixXd::Zero(n + m, n + m);
  block.topLeftCorner(n, n) = A * step_s;
  block.topRightCorner(n, m) = B * step_s;
  Eigen::MatrixXd exponential = block.exp();
  // Sets rounding errors to zero; otherwise structural zeros would become dense.
  exponential = exponential.unaryExpr([](double value) { return std::abs(value) < 1e-14 ? 0.0 : value; });
  return {exponential.topLeftCorner(n, n), exponential.topRightCorner(n, m)};
}

}  // namespace marble::examples
