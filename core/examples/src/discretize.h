// Zero-order hold of a linear system.
#pragma once

#include <Eigen/Core>

namespace marble::examples {

/// x⁺ = state · x + input · u after a step of ẋ = A x + B u with u held.
struct Discrete {
  Eigen::MatrixXd state, input;
};

[[nodiscard]] Discrete zero_order_hold(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, double step_s);

}  // namespace marble::examples
