#include "discretize.h"
#include "marble/examples.h"
#include "model.h"

namespace marble::examples {
namespace {

// Variables of one step; the last step has no inputs.
enum {
  kX,
  kY,
  kTheta,
  kVx,
  kVy,
  kOmega,
  kGimbal,
  kTriggerPlus,
  kTriggerMinus,
  kHoldPlus,
  kHoldMinus = kHoldPlus + 3,
  kThrust = kHoldMinus + 3,
  kGimbalRate,
  kStep
};

Discrete dynamics(const RocketParameters& p) {
  const double inertia = p.mass * 4.0 * p.half_length * p.half_length / 12.0;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(7, 7);
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(7, 2);
  A(kX, kVx) = 1.0;
  A(kY, kVy) = 1.0;
  A(kTheta, kOmega) = 1.0;
  A(kVx, kTheta) = -p.gravity;
  A(kVx, kGimbal) = -p.gravity;
  A(kOmega, kGimbal) = -p.mass * p.gravity * p.half_length / inertia;
  B(kVy, 0) = 1.0 / p.mass;
  B(kGimbal, 1) = 1.0;
  return zero_order_hold(A, B, p.step_s);
}

}  // namespace

OwnedProblem rocket(const RocketParameters& p) {
  const int last = p.steps - 1;
  Model model("rocket", kThrust * p.steps + 2 * last);
  const auto at = [](int k, int variable) { return static_cast<Index>(kStep * k + variable); };
  const Discrete step = dynamics(p);

  for (int i = 0; i < 7; ++i) model.equal_zero({{at(0, i), 1.0}}, -p.initial[i]);
  for (int k = 0; k < last; ++k) add_step(model, step, at(k + 1, 0), at(k, 0), at(k, kThrust));
  model.equal_zero({{at(last, kX), 1.0}}, -p.catch_x);
  model.equal_zero({{at(last, kY), 1.0}}, -p.catch_y);
  model.equal_zero({{at(last, kVx), 1.0}});
  model.equal_zero({{at(last, kVy), 1.0}});

  const double weight = p.mass * p.gravity;
  for (int k = 0; k < p.steps; ++k) {
    // (18), (19): the trigger and the triggered values, each split into its positive and negative parts.
    const Terms triggered[3] = {{{at(k, kX), 1.0}, {at(k, kTheta), -p.half_length}},  // (22): x − ℓθ
                                {{at(k, kX), 1.0}, {at(k, kTheta), p.half_length}},   // (23): x + ℓθ
                                {{at(k, kTheta), 1.0}, {at(k, kGimbal), 1.0}}};       // (24): θ + α
    model.equal_zero({{at(k, kTriggerPlus), 1.0}, {at(k, kTriggerMinus), -1.0}, {at(k, kY), 1.0}},
                     -p.trigger_altitude);
    Terms violation;
    for (int i = 0; i < 3; ++i) {
      Terms split = {{at(k, kHoldPlus + i), -1.0}, {at(k, kHoldMinus + i), 1.0}};
      model.equal_zero(split + triggered[i]);
      violation.push_back({at(k, kHoldMinus + i), 1.0});
    }
    model.complementary({{at(k, kTriggerPlus), 1.0}}, 0.0, violation, 0.0);  // (20), one pair for all three

    model.at_least_zero({{at(k, kTriggerMinus), 1.0}});
    for (int i = 0; i < 6; ++i) model.at_least_zero({{at(k, kHoldPlus + i), 1.0}});
    model.within({{at(k, kTheta), 1.0}}, p.largest_angle);
    model.within({{at(k, kGimbal), 1.0}}, p.largest_gimbal);
    model.within({{at(k, kOmega), 1.0}}, p.largest_rate);
    model.at_least_zero({{at(k, kY), 1.0}}, -p.half_length);
    model.at_least_zero({{at(k, kVy), -1.0}});
    model.at_least_zero({{at(k, kVy), 1.0}}, p.fastest_descent);
    if (k < last) {
      model.at_least_zero({{at(k, kThrust), 1.0}}, (1.0 - p.least_thrust) * weight);
      model.at_least_zero({{at(k, kThrust), -1.0}}, (p.most_thrust - 1.0) * weight);
    }

    model.add_square(p.x_weight, {{at(k, kX), 1.0}}, -p.catch_x);
    model.add_square(p.angle_weight, {{at(k, kTheta), 1.0}});
    model.add_square(p.rate_weight, {{at(k, kOmega), 1.0}});
    model.add_square(p.gimbal_weight, {{at(k, kGimbal), 1.0}});
    model.add_square(p.vx_weight, {{at(k, kVx), 1.0}});
    if (k < last) {
      model.add_square(p.thrust_weight, {{at(k, kThrust), 1.0}});
      model.add_square(p.gimbal_rate_weight, {{at(k, kGimbalRate), 1.0}});
    }
  }
  model.add_square(p.final_angle_weight, {{at(last, kTheta), 1.0}});
  model.add_square(p.final_rate_weight, {{at(last, kOmega), 1.0}});
  return model.problem();
}

}  // namespace marble::examples
