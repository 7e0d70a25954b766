// Zero-order hold of a linear system.
#pragma once

#include <Eigen/Core>

#include "model.h"

namespace marble::examples {

/// x⁺ = state · x + input · u after a step of ẋ = A x + B u with u held.
struct Discrete {
  Eigen::MatrixXd state, input;
};

/// state · x + input · u − x⁺ = 0, of variables that follow each other from these on.
void add_step(Model& model, const Discrete& step, Index next_state, Index state, Index input);

[[nodiscard]] Discrete zero_order_hold(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, double step_s);

}  // namespace marble::examples
