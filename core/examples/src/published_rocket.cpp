#include "discretize.h"
#include "marble/published_examples.h"
#include "model.h"

namespace marble::examples {
namespace {

constexpr int kSteps = 40;
constexpr double kStepS = 5.0 / (kSteps - 1);
constexpr double kMass = 1.0;
constexpr double kGravity = 9.81;
constexpr double kHalfLength = 0.5;

// Variables of one step; the last step has no inputs.
enum { kX, kY, kVx, kVy, kTheta, kOmega, kGimbal, kSides, kThrust = kSides + 8, kGimbalRate, kStep };

constexpr Index at(int k, int variable) { return kStep * k + variable; }
// (18), (19): the positive and the negative part of the trigger, 0, and of the three triggered values, 1
// to 3.
constexpr Index positive(int k, int i) { return at(k, kSides + 2 * i); }
constexpr Index negative(int k, int i) { return at(k, kSides + 2 * i + 1); }

Discrete dynamics() {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(7, 7);
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(7, 2);
  A(kX, kVx) = A(kY, kVy) = A(kTheta, kOmega) = 1.0;
  A(kVx, kTheta) = A(kVx, kGimbal) = -kGravity;
  A(kOmega, kGimbal) = -kMass * kGravity * 3.0 / kHalfLength;  // by the inertia m ℓ² / 3
  B(kVy, 0) = 1.0 / kMass;
  B(kGimbal, 1) = 1.0;
  return zero_order_hold(A, B, kStepS);
}

void move(Model& model, int k, const Discrete& step) {
  add_step(model, step, at(k + 1, 0), at(k, 0), at(k, kThrust));
  model.at_least_zero({{at(k, kThrust), 1.0}}, kMass * kGravity);
  model.at_least_zero({{at(k, kThrust), -1.0}}, 12.0 - kMass * kGravity);
  model.within({{at(k, kGimbalRate), 1.0}}, 0.8);
  model.add_square(kStepS, {{at(k, kThrust), 1.0}}, kMass * kGravity);
}

void trigger(Model& model, int k, double altitude) {
  const Terms triggered[3] = {{{at(k, kTheta), 1.0}, {at(k, kGimbal), 1.0}},
                              {{at(k, kX), 1.0}, {at(k, kTheta), -kHalfLength}},
                              {{at(k, kX), 1.0}, {at(k, kTheta), kHalfLength}}};
  model.equal_zero({{positive(k, 0), 1.0}, {negative(k, 0), -1.0}, {at(k, kY), 1.0}}, -altitude);
  Terms violation;
  for (int i = 1; i <= 3; ++i) {
    model.equal_zero(Terms{{positive(k, i), -1.0}, {negative(k, i), 1.0}} + triggered[i - 1]);
    violation.push_back({negative(k, i), 1.0});
  }
  for (int i = 0; i <= 3; ++i) {
    for (const Index part : {positive(k, i), negative(k, i)}) {
      model.at_least_zero({{part, 1.0}});
      model.add_linear(kStepS, part);
    }
  }
  model.complementary({{positive(k, 0), 1.0}}, 0.0, violation, 0.0);  // (20)
}

}  // namespace

OwnedProblem published_rocket(double trigger_altitude) {
  const int last = kSteps - 1;
  Model model("published rocket", at(last, kThrust));
  const double initial[7] = {10.0, 20.0, -3.0, -8.0, 0.15, 0.2, 0.0};
  for (int i = 0; i < 7; ++i) model.equal_zero({{at(0, i), 1.0}}, -initial[i]);
  model.equal_zero({{at(last, kY), 1.0}}, -1.5);
  for (const int i : {kVx, kVy, kTheta}) model.equal_zero({{at(last, i), 1.0}});
  model.at_least_zero({{at(last, kX), 1.0}});
  model.at_least_zero({{at(last, kX), -1.0}}, 1.0);
  const Discrete step = dynamics();
  for (int k = 0; k < kSteps; ++k) {
    if (k < last) move(model, k, step);
    trigger(model, k, trigger_altitude);
    model.within({{at(k, kTheta), 1.0}}, 0.2);
    model.within({{at(k, kOmega), 1.0}}, 0.6);
    model.within({{at(k, kGimbal), 1.0}}, 0.5);
    model.add_square(kStepS, {{at(k, kGimbal), 1.0}});
  }
  return model.problem();
}

}  // namespace marble::examples
