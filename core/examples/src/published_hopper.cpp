#include "marble/published_examples.h"
#include "model.h"

namespace marble::examples {
namespace {

constexpr int kSteps = 60;
constexpr double kStepS = 0.05;
constexpr double kGravity = 9.81;
constexpr double kFriction = 0.1;
constexpr double kLegScale = 90.0;      // N, of the leg's force
constexpr double kContactScale = 30.0;  // N, of the ground's force
constexpr double kSlipScale = 1.0 / 20.0;
constexpr double kGoalStep = 0.04;  // m per step
constexpr double kEdge[4] = {0.5, 0.75, 1.0, 2.0};
constexpr double kRise[4] = {0.1, 0.1, 0.1, -0.3};

// Variables of one step: state after it, forces, slips, and for each edge the sign and the multipliers above
// and below (17).
enum {
  kFootX,
  kFootZ,
  kHeadX,
  kHeadZ,
  kVelocity,
  kLeg = 8,
  kContact = 10,
  kSlip = 12,
  kEdges = 14,
  kStep = 26
};

constexpr Index at(int k, int variable) { return kStep * k + variable; }
constexpr Index sign(int k, int j) { return at(k, kEdges + 3 * j); }
constexpr Index above(int k, int j) { return sign(k, j) + 1; }
constexpr Index below(int k, int j) { return sign(k, j) + 2; }

// Returns a value minus its predecessor, times a factor; before the first step all values are zero.
Terms change(int k, int variable, double factor) {
  Terms terms = {{at(k, variable), factor}};
  if (k > 0) terms.push_back({at(k - 1, variable), -factor});
  return terms;
}

// Backward Euler, masses of 1 kg. The leg's force excludes its load at rest: both weights act on the foot.
void move(Model& model, int k) {
  for (int d = 0; d < 2; ++d) {
    model.equal_zero(change(k, kFootX + d, 1.0) + Terms{{at(k, kVelocity + d), -kStepS}});
    model.equal_zero(change(k, kHeadX + d, 1.0) + Terms{{at(k, kVelocity + 2 + d), -kStepS}});
    model.equal_zero(change(k, kVelocity + d, 1.0 / kStepS) +
                         Terms{{at(k, kContact + d), -kContactScale}, {at(k, kLeg + d), -kLegScale}},
                     d == 0 ? 0.0 : 2.0 * kGravity);
    model.equal_zero(change(k, kVelocity + 2 + d, 1.0 / kStepS) + Terms{{at(k, kLeg + d), kLegScale}});
  }
}

void touch(Model& model, int k) {
  Terms distance = {{at(k, kFootZ), 1.0}};  // to the ground below: z − Σ ½ rise (sign + 1)
  double constant = 0.0;
  for (int j = 0; j < 4; ++j) {
    model.equal_zero({{at(k, kFootX), 1.0}, {above(k, j), -1.0}, {below(k, j), 1.0}}, -kEdge[j]);
    distance.push_back({sign(k, j), -0.5 * kRise[j]});
    constant -= 0.5 * kRise[j];
    model.complementary({{above(k, j), 1.0}}, 0.0, {{sign(k, j), -1.0}}, 1.0);
    model.complementary({{below(k, j), 1.0}}, 0.0, {{sign(k, j), 1.0}}, 1.0);
  }
  const Terms slips = {{at(k, kSlip), kSlipScale}, {at(k, kSlip + 1), kSlipScale}};
  model.equal_zero(change(k, kFootX, 1.0) +
                   Terms{{at(k, kSlip), -kSlipScale}, {at(k, kSlip + 1), kSlipScale}});  // (14)
  model.at_least_zero(distance, constant);
  for (const double side : {-1.0, 1.0})
    model.at_least_zero({{at(k, kContact + 1), kFriction}, {at(k, kContact), side}});  // (16)
  for (const Term& slip : slips) model.at_least_zero({slip});
  model.complementary(distance + slips, constant, {{at(k, kContact + 1), 1.0}}, 0.0);  // (15)
}

// Weighs the state at the beginning of each step from the second on, and the final state against a goal
// farther ahead.
void add_cost(Model& model, int k) {
  const double on_the_way[8] = {10.0, 0.0, 10.0, 0.0, 0.1, 0.1, 0.1, 0.1};
  const double at_the_end[8] = {1e3, 0.0, 1e3, 1e3, 1e-2, 1e-2, 1e-2, 1e-2};
  const bool last = k + 1 == kSteps;
  const double goal = kGoalStep * (k + 1) + (last ? 0.3 : 0.0);
  for (int i = 0; i < 8; ++i) {
    model.add_square(last ? at_the_end[i] : on_the_way[i], {{at(k, i), 1.0}},
                     i == kFootX || i == kHeadX ? -goal : 0.0);
  }
  model.add_square(10.0, {{at(k, kFootZ), 1.0}, {at(k, kHeadZ), -1.0}});
  for (int i = 0; i < 2; ++i) {
    model.add_square(1e-3 / (kLegScale * kLegScale), {{at(k, kLeg + i), 1.0}});
    if (k > 0) model.add_square(1.0 / 9.0, change(k, kLeg + i, 1.0));
    model.add_square(kSlipScale * kSlipScale, {{at(k, kSlip + i), 1.0}});
  }
}

}  // namespace

OwnedProblem published_hopper() {
  Model model("published hopper", at(kSteps, 0));
  for (int k = 0; k < kSteps; ++k) {
    move(model, k);
    touch(model, k);
    add_cost(model, k);
  }
  return model.problem();
}

}  // namespace marble::examples
