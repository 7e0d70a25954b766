#include <Eigen/Geometry>

#include "discretize.h"
#include "marble/examples.h"
#include "model.h"

namespace marble::examples {
namespace {

constexpr int kStates = 9;  // position, velocity, roll, pitch, yaw
constexpr int kInputs = 4;  // thrust deviation, body rates
// Variables of one gate in one step: progress γ, its control μ, slack s (3), positive and negative parts e⁺,
// e⁻ of the error (3 each).
enum {
  kProgress,
  kControl,
  kSlack,
  kNormPlus = kSlack + 3,
  kNormMinus = kNormPlus + 3,
  kGateVariables = kNormMinus + 3
};

Discrete dynamics(const GatesParameters& p) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(kStates, kStates);
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(kStates, kInputs);
  A.block(0, 3, 3, 3).setIdentity();
  A(3, 7) = p.gravity;   // pitch accelerates forward
  A(4, 6) = -p.gravity;  // roll accelerates sideways
  B(5, 0) = 1.0 / p.mass;
  B.block(6, 1, 3, 3).setIdentity();
  return zero_order_hold(A, B, p.step_s);
}

}  // namespace

OwnedProblem gates(const GatesParameters& p) {
  const int count = static_cast<int>(p.gates.size());
  const int last = p.steps - 1;
  const int per_step = kStates + kGateVariables * count + kInputs;
  Model model("gates", per_step * p.steps - kInputs);
  const auto state = [&](int k, int i) { return static_cast<Index>(per_step * k + i); };
  const auto gate_variable = [&](int k, int j, int i) { return state(k, kStates + kGateVariables * j + i); };
  const auto input = [&](int k, int i) { return state(k, kStates + kGateVariables * count + i); };
  const Discrete step = dynamics(p);

  for (int i = 0; i < kStates; ++i) model.equal_zero({{state(0, i), 1.0}}, -p.initial[i]);
  for (int k = 0; k < last; ++k) add_step(model, step, state(k + 1, 0), state(k, 0), input(k, 0));
  for (int i = 0; i < 6; ++i) model.equal_zero({{state(last, i), 1.0}}, -p.final[i]);

  for (int k = 0; k < p.steps; ++k) {
    for (int j = 0; j < count; ++j) {
      const Gate& gate = p.gates[j];
      Terms progress = {{gate_variable(k, j, kProgress), 1.0},
                        {gate_variable(k, j, kControl), -1.0}};  // (25)
      if (k > 0) progress.push_back({gate_variable(k - 1, j, kProgress), -1.0});
      model.equal_zero(progress);

      const Eigen::Matrix3d world_to_gate =
          Eigen::AngleAxisd(-gate.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      const Eigen::Vector3d center =
          world_to_gate * Eigen::Vector3d(gate.center[0], gate.center[1], gate.center[2]);
      Terms norm;
      for (int i = 0; i < 3; ++i) {  // R_W (r − o) + s = e⁺ − e⁻
        Terms offset = {{gate_variable(k, j, kSlack + i), 1.0},
                        {gate_variable(k, j, kNormPlus + i), -1.0},
                        {gate_variable(k, j, kNormMinus + i), 1.0}};
        for (int a = 0; a < 3; ++a) offset.push_back({state(k, a), world_to_gate(i, a)});
        model.equal_zero(offset, -center[i]);
        norm.push_back({gate_variable(k, j, kNormPlus + i), 1.0});
        norm.push_back({gate_variable(k, j, kNormMinus + i), 1.0});
        model.within({{gate_variable(k, j, kSlack + i), 1.0}}, gate.half_extent[i]);  // (29)
      }
      for (const Term& part : norm) model.at_least_zero({part});
      if (j + 1 < count) {  // (27)
        model.at_least_zero(
            {{gate_variable(k, j, kProgress), 1.0}, {gate_variable(k, j + 1, kProgress), -1.0}});
      }
      model.complementary({{gate_variable(k, j, kControl), 1.0}}, 0.0, norm, 0.0);  // (28)
    }
    for (int i = 0; i < 3; ++i)
      model.within({{state(k, 6 + i), 1.0}}, i < 2 ? p.largest_tilt : p.largest_yaw);
    for (int i = 0; i < 3; ++i) {
      model.add_square(p.velocity_weight, {{state(k, 3 + i), 1.0}});
      model.add_square(p.angle_weight, {{state(k, 6 + i), 1.0}});
    }
    if (k == last) continue;
    const double bounds[kInputs] = {p.most_thrust, p.largest_rate, p.largest_rate, p.largest_yaw_rate};
    for (int i = 0; i < kInputs; ++i) {
      model.within({{input(k, i), 1.0}}, bounds[i]);
      model.add_square(i == 0 ? p.thrust_weight : p.rate_weight, {{input(k, i), 1.0}});
    }
  }
  for (int j = 0; j < count; ++j) model.equal_zero({{gate_variable(last, j, kProgress), 1.0}}, -1.0);  // (26)
  return model.problem();
}

}  // namespace marble::examples
