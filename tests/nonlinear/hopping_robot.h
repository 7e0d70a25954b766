// A hopper on a vertical rail: a body over a knee that is driven, with two links of the same length, and a
// foot that the floor pushes.
//
//   m (v' + g) = λ,   I w' = τ + 2ℓ sin q λ,   0 ≤ z − 2ℓ cos q ⊥ λ ≥ 0
//
// by implicit Euler steps of 20 ms: z, q, their speeds v, w, the torque τ and the force λ of each stage.
#pragma once

#include <array>
#include <vector>

#include "marble/nonlinear.h"

namespace marble::testing {

class HoppingRobot {
 public:
  enum Part : Index { kHeight, kKnee, kSpeed, kTurn, kState, kTorque = kState, kForce, kParts };
  using State = std::array<double, kState>;

  static constexpr double kStep = 0.02;  // seconds: 50 Hz

  explicit HoppingRobot(Index stages);

  /// The plan's functions, which refer to this: the state that it begins with, then the stages. The first
  /// rows of c_E are that state less what set() says.
  [[nodiscard]] nonlinear::Problem problem();
  /// Moves a plan on by a stage.
  [[nodiscard]] Shift one_stage() const;
  /// Of x: where a part of a stage is. Stage −1 is where the plan begins.
  [[nodiscard]] static std::size_t at(Index stage, Index part) {
    return static_cast<std::size_t>(stage < 0 ? part : kState + kParts * stage + part);
  }

  /// The time of the plan's beginning, and its state then, unless that is a measurement.
  void set(std::int64_t tick, const State& begin = {}) { tick_ = tick, begin_ = begin; }

  /// What a step costs that ends in this state at this tick.
  [[nodiscard]] static double cost(const State& state, double torque, std::int64_t tick);
  [[nodiscard]] static State standing();
  [[nodiscard]] static double foot_height(const State& state);

 private:
  nonlinear::Values values(std::span<const double> x);
  nonlinear::Derivatives derivatives(std::span<const double> x);

  Index stages_;
  std::int64_t tick_ = 0;
  State begin_ = {};
  std::vector<double> equalities_, G_, H_, residuals_, gradient_;
  SparseMatrix of_equalities_, of_G_, of_H_, of_residuals_;
};

/// The state that a torque leads to, after a step. `guess` is a stage that may be near. Throws
/// where it finds none.
[[nodiscard]] HoppingRobot::State step_of_the_world(const HoppingRobot::State& state, double torque,
                                                    std::span<const double> guess);

}  // namespace marble::testing
