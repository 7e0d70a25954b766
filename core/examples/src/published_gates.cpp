#include <Eigen/Geometry>
#include <numbers>
#include <utility>

#include "discretize.h"
#include "marble/published_examples.h"
#include "model.h"

namespace marble::examples {
namespace {

constexpr int kSteps = 30;
constexpr int kLast = kSteps - 1;
constexpr double kGravity = 9.81;
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kTilt = 20.0 * kDegree;
constexpr double kRate[3] = {2.0, 2.0, 1.5};
constexpr double kHalfExtent[3] = {0.5, 0.05, 0.5};
constexpr int kGates = 4;
constexpr struct {
  double center[3];
  double yaw;
} kGate[kGates] = {{{-2.0, 2.0, 0.25}, 45.0 * kDegree},
                   {{1.0, 6.0, 1.0}, -45.0 * kDegree},
                   {{2.0, 3.0, 2.0}, 0.0},
                   {{-4.0, 6.0, 0.5}, 20.0 * kDegree}};

// Variables of one step: position, attitude and velocity; for each gate its error, the control of its
// progress, the excess of the error above and below, and its progress; inputs, except in the last step.
enum { kAttitude = 3, kVelocity = 6, kStates = 9, kInputs = 4 };
enum { kError, kControl = 3, kAbove = 4, kBelow = 7, kProgress = 10, kGateVariables = 11 };
constexpr Index kStep = kStates + kGates * kGateVariables + kInputs;

constexpr Index state(int k, int i) { return kStep * k + i; }
constexpr Index gate(int k, int j, int i) { return state(k, kStates + kGateVariables * j + i); }
constexpr Index input(int k, int i) { return state(k, kStates + kGateVariables * kGates + i); }

Discrete dynamics(double step_s) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(kStates, kStates);
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(kStates, kInputs);
  A.block(0, kVelocity, 3, 3).setIdentity();
  A(kVelocity, kAttitude + 1) = 2.0 * kGravity;  // the attitude is in half angles
  A(kVelocity + 1, kAttitude) = -2.0 * kGravity;
  B(kVelocity + 2, 0) = 1.0;
  B.block(kAttitude, 1, 3, 3) = 0.5 * Eigen::Matrix3d::Identity();
  return zero_order_hold(A, B, step_s);
}

void move(Model& model, int k, const Discrete& step, double step_s) {
  add_step(model, step, state(k + 1, 0), state(k, 0), input(k, 0));
  for (int i = 0; i < kInputs; ++i) {  // thrust, as the excess over the weight, and rates
    model.at_least_zero({{input(k, i), 1.0}}, i == 0 ? kGravity : kRate[i - 1]);
    model.at_least_zero({{input(k, i), -1.0}}, i == 0 ? 3.0 * kGravity : kRate[i - 1]);
    model.add_square(step_s, {{input(k, i), 1.0}}, i == 0 ? kGravity : 0.0);
  }
}

void pass(Model& model, int k, int j, double slack_weight) {
  Terms progress = {{gate(k, j, kProgress), 1.0}, {gate(k, j, kControl), -1.0}};  // (25)
  if (k > 0) progress.push_back({gate(k - 1, j, kProgress), -1.0});
  model.equal_zero(progress);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(-kGate[j].yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d center = turn * Eigen::Map<const Eigen::Vector3d>(kGate[j].center);
  Terms beside;
  for (int i = 0; i < 3; ++i) {
    const Index error = gate(k, j, kError + i);
    Terms offset = {{error, -1.0}};
    for (int a = 0; a < 3; ++a) offset.push_back({state(k, a), turn(i, a)});
    model.equal_zero(offset, -center[i]);
    for (const auto& [slack, side] :
         {std::pair{gate(k, j, kAbove + i), -1.0}, {gate(k, j, kBelow + i), 1.0}}) {
      model.at_least_zero({{error, side}, {slack, 1.0}}, kHalfExtent[i]);
      model.at_least_zero({{slack, 1.0}});
      model.add_linear(slack_weight, slack);
      beside.push_back({slack, 1.0});
    }
  }
  if (j + 1 < kGates)  // (27)
    model.at_least_zero({{gate(k, j, kProgress), 1.0}, {gate(k, j + 1, kProgress), -1.0}});
  model.complementary({{gate(k, j, kControl), 1.0}}, 0.0, beside, 0.0);  // (28)
}

}  // namespace

OwnedProblem published_gates(const PublishedGatesParameters& parameters) {
  const double step_s = parameters.horizon_s / kLast;
  Model model("published gates", input(kLast, 0));
  for (int i = 0; i < kStates; ++i) model.equal_zero({{state(0, i), 1.0}});
  for (int i = 0; i < 6; ++i) {
    const int held = i < 3 ? i : i - 3 + (parameters.end_at_rest ? kVelocity : kAttitude);
    model.equal_zero({{state(kLast, held), 1.0}}, i == 1 ? -10.0 : 0.0);
  }
  for (int j = 0; j < kGates; ++j) model.equal_zero({{gate(kLast, j, kProgress), 1.0}}, -1.0);  // (26)
  const Discrete step = dynamics(step_s);
  for (int k = 0; k < kSteps; ++k) {
    if (k < kLast) move(model, k, step, step_s);
    for (int i = 0; i < 3; ++i) model.within({{state(k, kAttitude + i), 1.0}}, kTilt);
    for (int j = 0; j < kGates; ++j) pass(model, k, j, parameters.slack_weight * step_s);
  }
  return model.problem();
}

}  // namespace marble::examples
