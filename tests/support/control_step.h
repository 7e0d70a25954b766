// Generates random steps of a controller that plans through contacts, each with a feasible plan: the roll-out
// of its inputs.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>

#include "marble/problem.h"

namespace marble::testing {

/// A linear complementarity system x⁺ = A x + B u + D λ, 0 ≤ λ ⊥ E x + F λ + H u + c ≥ 0, whose F is positive
/// definite, so that each input has exactly one λ. Planned over 5 to 12 stages with 2 to 6 states, 1 or 2
/// inputs and 2 to 4 pairs, with bounds on the inputs and a quadratic cost of states and inputs. The same for
/// the same seed on every machine.
class ControlSteps {
 public:
  explicit ControlSteps(std::uint64_t seed);

  /// Returns the step from the current state. `initial_z` is the roll-out of the current planned inputs.
  [[nodiscard]] OwnedProblem problem() const;
  /// Moves near the state that the first input leads to, with the inputs shifted by a stage and another
  /// target: g, c₀, b and r change, the rest of the problem stays.
  void advance();

 private:
  [[nodiscard]] double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-52 - 1.0; }
  [[nodiscard]] Eigen::MatrixXd random(Index rows, Index columns, double size);
  [[nodiscard]] Eigen::VectorXd forces(const Eigen::VectorXd& x, const Eigen::VectorXd& u) const;

  std::mt19937_64 engine_;
  Index stages_, states_, inputs_, pairs_;
  Eigen::MatrixXd A_, B_, D_, E_, F_, H_, plan_;  // plan_: a column of inputs per stage
  Eigen::VectorXd c_, state_, target_;
};

}  // namespace marble::testing
