// Generates the three robotics problems of the paper (section VI.B): contact, state-triggered and progress
// constraints. Formulas cite the paper's equations; with default parameters, the sizes are those of its
// Table I. Also generates random QPECs, which have no structure to exploit.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "marble/problem.h"
#include "marble/solution.h"

namespace marble::examples {

/// A planar hopper, a body and a foot joined by a leg force, that tracks a moving point over two steps up and
/// two steps down.
struct HopperParameters {
  int steps = 60;                                                 ///< horizon, >= 1
  double step_s = 0.05;                                           ///< seconds
  double gravity = 9.81;                                          ///< m/s²
  double body_mass = 1.0;                                         ///< kg
  double foot_mass = 0.3;                                         ///< kg
  double friction = 0.8;                                          ///< μ of (16)
  std::array<double, 4> stair_x = {0.75, 1.15, 1.85, 2.25};       ///< m, x of the jumps in the ground
  std::array<double, 4> stair_rise = {0.15, 0.15, -0.15, -0.15};  ///< m, heights of these jumps
  double leg_reach_x = 0.30;                                      ///< m, largest |x_body − x_foot|
  double leg_shortest = 0.35;                                     ///< m
  double leg_longest = 0.85;                                      ///< m
  std::array<double, 4> position = {0.0, 0.6, 0.0,
                                    0.0};  ///< x, z of body, x, z of foot before the first step
  std::array<double, 4> velocity = {0.0, 0.0, 0.0, 0.0};  ///< velocities in the same order
  std::array<double, 2> last_force = {0.0, 9.81};         ///< leg force before the first step, N
  double reference_x = 0.0;         ///< m, position of the tracked point before the first step
  double speed = 1.0;               ///< m/s of the tracked point
  double tracking_weight = 20.0;    ///< of the squared distance of the body from the point, 1/m²
  double force_weight = 0.005;      ///< of the squared leg force, 1/N²
  double force_rate_weight = 0.01;  ///< of its squared change from step to step, 1/N²
};

/// Variables of one step of the hopper, in their order in z.
enum HopperVariable {
  kBodyX,
  kBodyZ,
  kFootX,
  kFootZ,
  kBodyVx,
  kBodyVz,
  kFootVx,
  kFootVz,
  kForceX,
  kForceZ,  // leg force on the body
  kSlipPlus,
  kSlipMinus,  // v_t⁺, v_t⁻ of (14)
  kNormalForce,
  kFrictionForce,
  kSign,                       // 4 signs of (17)
  kSignPlus = kSign + 4,       // their 4 multipliers λ⁺
  kSignMinus = kSignPlus + 4,  // and λ⁻
  kHopperVariables = kSignMinus + 4
};

/// Returns the index in z of a variable of step k ≥ 0: the body's height after the first step is
/// z[hopper_index(0, kBodyZ)], the second sign of step 7 is z[hopper_index(7, kSign + 1)].
[[nodiscard]] constexpr Index hopper_index(int step, int variable) {
  return static_cast<Index>(kHopperVariables * step + variable);
}

/// Returns the problem of these parameters: kHopperVariables variables and 9 pairs per step.
[[nodiscard]] OwnedProblem hopper(const HopperParameters& parameters = {});

/// Advances a receding horizon: returns the parameters after the first `ticks` steps of the trajectory z,
/// 1 <= ticks <= parameters.steps. State, last force and reference change; all other parameters stay.
[[nodiscard]] HopperParameters advance(HopperParameters parameters, std::span<const double> z, int ticks = 1);

/// Returns a warm start for the next control step: the plan's steps and multipliers shifted by one, the last
/// one repeated.
[[nodiscard]] Solution shift_hopper(Solution plan);

/// A rocket, linearized about upright, that must be in front of its tower with the engine turned away once it
/// is low.
struct RocketParameters {
  int steps = 40;                  ///< horizon, >= 2
  double step_s = 0.25;            ///< seconds
  double gravity = 9.81;           ///< m/s²
  double mass = 1.0;               ///< kg
  double half_length = 2.0;        ///< m
  double trigger_altitude = 18.0;  ///< m; below it the constraints (22)–(24) hold
  std::array<double, 7> initial = {13.0, 25.5, 0.0, -4.0, -4.0, 0.0, 0.0};  ///< x, y, θ, vx, vy, ω, gimbal α
  double catch_x = 0.5;                                                     ///< m, where the tower catches it
  double catch_y = 6.0;                                                     ///< m
  double largest_angle = 0.35;                                              ///< rad
  double largest_gimbal = 0.25;                                             ///< rad
  double largest_rate = 0.5;                                                ///< rad/s
  double fastest_descent = 6.0;                                             ///< m/s
  double least_thrust = 0.4;                                                ///< of the weight
  double most_thrust = 1.6;                                                 ///< of the weight
  double thrust_weight = 4.0;          ///< of the square in the cost, like all following weights
  double gimbal_rate_weight = 400.0;   ///< of the gimbal's rate
  double angle_weight = 400.0;         ///< of θ
  double rate_weight = 400.0;          ///< of ω
  double gimbal_weight = 400.0;        ///< of α
  double x_weight = 0.5;               ///< of the distance to catch_x
  double vx_weight = 1.0;              ///< of vx
  double final_angle_weight = 2000.0;  ///< of θ at the end
  double final_rate_weight = 2000.0;   ///< of ω at the end
};

/// Returns the problem of these parameters.
[[nodiscard]] OwnedProblem rocket(const RocketParameters& parameters = {});

/// A window that the quadrotor must fly through.
struct Gate {
  std::array<double, 3> center;       ///< m
  double yaw;                         ///< rad, of its normal
  std::array<double, 3> half_extent;  ///< m, along its own axes
};

/// A quadrotor, linearized about hover, that flies through gates in their order.
struct GatesParameters {
  int steps = 30;         ///< horizon, >= 2
  double step_s = 0.12;   ///< seconds
  double gravity = 9.81;  ///< m/s²
  double mass = 1.0;      ///< kg
  std::array<double, 9> initial = {0.0, 0.0, 1.0, 0, 0,
                                   0,   0,   0,   0};      ///< position, velocity, roll, pitch, yaw
  std::array<double, 6> final = {6.0, 0.0, 1.0, 0, 0, 0};  ///< position, velocity
  std::vector<Gate> gates = {{{1.5, 0.9, 1.3}, 0.4, {0.15, 0.3, 0.3}},
                             {{2.9, -0.6, 1.7}, -0.8, {0.15, 0.3, 0.3}},
                             {{4.0, 0.7, 0.9}, 0.9, {0.15, 0.3, 0.3}},
                             {{5.2, -0.5, 1.4}, -0.5, {0.15, 0.3, 0.3}}};  ///< in their order
  double largest_tilt = 0.6;                                               ///< rad, of roll and pitch
  double largest_yaw = 0.6;                                                ///< rad
  double most_thrust = 8.0;                                                ///< m/s², deviation from hover
  double largest_rate = 4.0;                                               ///< rad/s, of roll and pitch
  double largest_yaw_rate = 2.0;                                           ///< rad/s
  double velocity_weight = 1.0;  ///< of the square in the cost, like all following weights
  double angle_weight = 10.0;    ///< of roll, pitch and yaw
  double thrust_weight = 2.0;    ///< of the thrust's deviation
  double rate_weight = 4.0;      ///< of the body rates
};

/// Returns the problem of these parameters.
[[nodiscard]] OwnedProblem gates(const GatesParameters& parameters = {});

/// A random convex QP with equilibrium constraints, after Jiang and Ralph, "QPECgen" (1999):
/// min ½ (x, y)ᵀQ(x, y) + gᵀ(x, y)  s.t.  C x + d ≥ 0,  0 ≤ y ⊥ N x + M y + r ≥ 0. M is positive definite
/// and not symmetric, everything is dense, and a feasible point has the given number of degenerate pairs.
struct QpecParameters {
  Index upper_variables = 20;  ///< x, >= 1
  Index lower_variables = 80;  ///< y, >= 1; also the number of pairs
  Index constraints = 4;       ///< on x alone
  Index degenerate_pairs = 4;  ///< <= lower_variables
};

/// Returns the problem of these sizes. A seed gives the same problem on every machine.
[[nodiscard]] OwnedProblem qpec(const QpecParameters& parameters, std::uint64_t seed);

/// Varies the parameters by a few percent. A seed gives the same result on every machine; seed 0 is the
/// nominal problem.
[[nodiscard]] HopperParameters vary(HopperParameters parameters, std::uint64_t seed);
/// The same for a rocket.
[[nodiscard]] RocketParameters vary(RocketParameters parameters, std::uint64_t seed);
/// The same for a quadrotor.
[[nodiscard]] GatesParameters vary(GatesParameters parameters, std::uint64_t seed);

}  // namespace marble::examples
