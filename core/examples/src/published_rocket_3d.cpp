#include <cmath>
#include <numbers>

#include "discretize.h"
#include "marble/published_examples.h"
#include "model.h"

namespace marble::examples {
namespace {

constexpr double kMass = 1.0;
constexpr double kGravity = 9.81;
constexpr double kGimbalArm = 0.7;                  // m, from the centre of mass
constexpr double kInertia[3] = {0.25, 0.25, 0.06};  // kg m²
constexpr double kTriggerAltitude = 6.0;
constexpr double kHalfWidth = 0.45;  // m, of the corridor at the tower
constexpr double kRadian = std::numbers::pi / 180.0;

// Variables of one step. The attitude is half of a rotation vector.
enum {
  kPosition,
  kAttitude = 3,
  kVelocity = 6,
  kRate = 9,
  kThrust = 12,  // deviation from the weight
  kGimbal,
  kTriggerPlus = kGimbal + 2,
  kTriggerMinus,
  kHoldPlus,
  kHoldMinus = kHoldPlus + 4,
  kStep = kHoldMinus + 4
};

Discrete dynamics(double step_s) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(12, 12);
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(12, 3);
  A.block(kPosition, kVelocity, 3, 3).setIdentity();
  A.block(kAttitude, kRate, 3, 3) = 0.5 * Eigen::Matrix3d::Identity();
  A(kVelocity, kAttitude + 1) = 2.0 * kGravity;
  A(kVelocity + 1, kAttitude) = -2.0 * kGravity;
  B(kVelocity, 2) = kGravity;
  B(kVelocity + 1, 1) = -kGravity;
  B(kVelocity + 2, 0) = 1.0 / kMass;
  for (int i = 0; i < 2; ++i) B(kRate + i, 1 + i) = -kGimbalArm * kMass * kGravity / kInertia[i];
  return zero_order_hold(A, B, step_s);
}

}  // namespace

OwnedProblem published_rocket_3d(const PublishedRocket3dParameters& p) {
  const int last = p.steps - 1;
  const double step_s = p.horizon_s / last;
  const double weight = kMass * kGravity;
  Model model("published rocket 3d", static_cast<Index>(kStep) * p.steps);
  const auto at = [](int k, int variable) { return static_cast<Index>(kStep * k + variable); };
  const double first[12] = {5.0, 5.0, 22.0, 0.04, -0.06, 0.0, 0.0, 1.0, -1.2, 0.0, 0.0, 0.0};
  const double end[12] = {0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  for (int i = 0; i < 12; ++i) {
    model.equal_zero({{at(0, i), 1.0}}, -first[i]);
    model.equal_zero({{at(last, i), 1.0}}, -end[i]);
  }
  const double slope = std::tan(14.0 * kRadian);
  const double largest_attitude[3] = {25.0 * kRadian, 25.0 * kRadian, 15.0 * kRadian};
  const double largest_rate[3] = {1.2, 1.2, 0.6};  // rad/s
  const Discrete step = dynamics(step_s);
  for (int k = 0; k < p.steps; ++k) {
    if (k < last) add_step(model, step, at(k + 1, 0), at(k, 0), at(k, kThrust));
    model.at_least_zero({{at(k, kThrust), 1.0}}, 0.75 * weight);
    model.at_least_zero({{at(k, kThrust), -1.0}}, 0.8 * weight);
    for (int i = 0; i < 2; ++i) model.within({{at(k, kGimbal + i), 1.0}}, 15.0 * kRadian);
    for (int i = 0; i < 3; ++i) {
      model.within({{at(k, kAttitude + i), 1.0}}, largest_attitude[i]);
      model.within({{at(k, kRate + i), 1.0}}, largest_rate[i]);
    }
    // Below the trigger's altitude: in front of the tower, in its corridor, the engine turned away from it.
    const Index x = at(k, kPosition), y = at(k, kPosition + 1);
    const Terms triggered[4] = {{{y, 1.0}},
                                {{x, 1.0}, {y, slope}},
                                {{x, -1.0}, {y, slope}},
                                {{at(k, kGimbal), 1.0}, {at(k, kAttitude), 2.0}}};
    const double constants[4] = {0.0, kHalfWidth, kHalfWidth, 0.0};
    model.equal_zero({{at(k, kPosition + 2), 1.0}, {at(k, kTriggerPlus), 1.0}, {at(k, kTriggerMinus), -1.0}},
                     -kTriggerAltitude);
    Terms violation;
    for (int i = 0; i < 4; ++i) {
      model.equal_zero(Terms{{at(k, kHoldPlus + i), -1.0}, {at(k, kHoldMinus + i), 1.0}} + triggered[i],
                       constants[i]);
      violation.push_back({at(k, kHoldMinus + i), 1.0});
    }
    model.complementary({{at(k, kTriggerPlus), 1.0}}, 0.0, violation, 0.0);
    for (Index part = at(k, kTriggerMinus); part < at(k, kStep); ++part) model.at_least_zero({{part, 1.0}});

    model.add_square(step_s, {{at(k, kThrust), 1.0}}, weight);
    for (int i = 0; i < 2; ++i) model.add_square(15.0 * step_s, {{at(k, kGimbal + i), 1.0}});
    for (Index part = at(k, kTriggerPlus); part < at(k, kStep); ++part) model.add_linear(step_s, part);
  }
  return model.problem();
}

}  // namespace marble::examples
