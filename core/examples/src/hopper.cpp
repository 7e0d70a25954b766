#include <algorithm>

#include "marble/examples.h"
#include "model.h"

namespace marble::examples {

OwnedProblem hopper(const HopperParameters& p) {
  Model model("hopper", kHopperVariables * p.steps);
  const double h = p.step_s;
  double rise_sum = 0.0;
  for (const double rise : p.stair_rise) rise_sum += rise;

  for (int k = 0; k < p.steps; ++k) {
    const auto at = [k](int variable) { return hopper_index(k, variable); };
    const auto before = [k](int variable) { return hopper_index(k - 1, variable); };
    // Symplectic Euler: a value is its predecessor plus h times its rate. The first predecessor is the
    // initial state.
    const auto integrate = [&](int variable, double initial, const Terms& rate, double constant_rate) {
      Terms terms = {{at(variable), 1.0}};
      for (const Term& term : rate) terms.push_back({term.variable, -h * term.factor});
      if (k > 0) terms.push_back({before(variable), -1.0});
      model.equal_zero(terms, -h * constant_rate - (k > 0 ? 0.0 : initial));
    };
    for (int i = 0; i < 4; ++i) integrate(kBodyX + i, p.position[i], {{at(kBodyVx + i), 1.0}}, 0.0);
    const double to_body = 1.0 / p.body_mass;
    const double to_foot = 1.0 / p.foot_mass;
    integrate(kBodyVx, p.velocity[0], {{at(kForceX), to_body}}, 0.0);
    integrate(kBodyVz, p.velocity[1], {{at(kForceZ), to_body}}, -p.gravity);
    integrate(kFootVx, p.velocity[2], {{at(kForceX), -to_foot}, {at(kFrictionForce), to_foot}}, 0.0);
    integrate(kFootVz, p.velocity[3], {{at(kForceZ), -to_foot}, {at(kNormalForce), to_foot}}, -p.gravity);

    model.equal_zero({{at(kFootVx), 1.0}, {at(kSlipPlus), -1.0}, {at(kSlipMinus), 1.0}});  // (14)
    for (int i = 0; i < 4; ++i) {  // stationarity of the linear program (17) for sgn(x_foot − edge)
      model.equal_zero({{at(kFootX), 1.0}, {at(kSignPlus + i), -1.0}, {at(kSignMinus + i), 1.0}},
                       -p.stair_x[i]);
    }
    Terms distance = {{at(kFootZ), 1.0}};  // to the ground below: z − Σ ½ rise (sign + 1)
    for (int i = 0; i < 4; ++i) distance.push_back({at(kSign + i), -0.5 * p.stair_rise[i]});
    const double distance_constant = -0.5 * rise_sum;

    model.at_least_zero({{at(kSlipPlus), 1.0}});
    model.at_least_zero({{at(kSlipMinus), 1.0}});
    model.at_least_zero(distance, distance_constant);
    model.at_least_zero({{at(kNormalForce), p.friction}, {at(kFrictionForce), -1.0}});  // (16)
    model.at_least_zero({{at(kNormalForce), p.friction}, {at(kFrictionForce), 1.0}});
    model.within({{at(kBodyX), 1.0}, {at(kFootX), -1.0}}, p.leg_reach_x);
    model.at_least_zero({{at(kBodyZ), 1.0}, {at(kFootZ), -1.0}}, -p.leg_shortest);
    model.at_least_zero({{at(kBodyZ), -1.0}, {at(kFootZ), 1.0}}, p.leg_longest);

    model.complementary(Terms{{at(kSlipPlus), 1.0}, {at(kSlipMinus), 1.0}} + distance, distance_constant,
                        {{at(kNormalForce), 1.0}}, 0.0);  // (15)
    for (int i = 0; i < 4; ++i)
      model.complementary({{at(kSignPlus + i), 1.0}}, 0.0, {{at(kSign + i), -1.0}}, 1.0);
    for (int i = 0; i < 4; ++i)
      model.complementary({{at(kSignMinus + i), 1.0}}, 0.0, {{at(kSign + i), 1.0}}, 1.0);

    model.add_square(p.tracking_weight, {{at(kBodyX), 1.0}}, -(p.reference_x + p.speed * h * (k + 1)));
    for (int i = 0; i < 2; ++i) {
      model.add_square(p.force_weight, {{at(kForceX + i), 1.0}});
      if (k > 0) {
        model.add_square(p.force_rate_weight, {{at(kForceX + i), 1.0}, {before(kForceX + i), -1.0}});
      } else {
        model.add_square(p.force_rate_weight, {{at(kForceX + i), 1.0}}, -p.last_force[i]);
      }
    }
  }
  return model.problem();
}

HopperParameters advance(HopperParameters p, std::span<const double> z, int ticks) {
  const auto reached = [&](int variable) {
    return z[static_cast<std::size_t>(hopper_index(ticks - 1, variable))];
  };
  for (int i = 0; i < 4; ++i) {
    p.position[static_cast<std::size_t>(i)] = reached(kBodyX + i);
    p.velocity[static_cast<std::size_t>(i)] = reached(kBodyVx + i);
  }
  p.last_force = {reached(kForceX), reached(kForceZ)};
  p.reference_x += p.speed * p.step_s * ticks;
  return p;
}

Solution shift_hopper(Solution plan) {
  const auto shift = [](std::vector<double>& values, std::size_t per_step) {
    if (values.size() > per_step)
      std::copy(values.begin() + static_cast<std::ptrdiff_t>(per_step), values.end(), values.begin());
  };
  const std::size_t steps = plan.z.size() / kHopperVariables;
  for (auto* values : {&plan.z, &plan.equality_multipliers, &plan.inequality_multipliers,
                       &plan.complementarity_multipliers_L, &plan.complementarity_multipliers_R})
    shift(*values, values->size() / steps);
  return plan;
}

}  // namespace marble::examples
