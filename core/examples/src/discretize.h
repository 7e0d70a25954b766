// Discretizes a linear system with zero-order hold.
#pragma once

#include <Eigen/Core>

#include "model.h"

namespace marble::examples {

/// x⁺ = state · x + input · u after a step of ẋ = A x + B u with constant u.
struct Discrete {
  Eigen::MatrixXd state, input;
};

/// Adds the rows state · x + input · u − x⁺ = 0, for consecutive variables that begin at these indices.
void add_step(Model& model, const Discrete& step, Index next_state, Index state, Index input);

[[nodiscard]] Discrete zero_order_hold(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, double step_s);

}  // namespace marble::examples
