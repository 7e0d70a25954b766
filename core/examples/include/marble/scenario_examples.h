// Plans for scenarios that differ by one number: the rocket by its trigger's altitude, the hopper by the
// ground's friction.
#pragma once

#include <functional>
#include <vector>

#include "marble/composite/scenarios.h"
#include "marble/examples.h"

namespace marble::examples {

/// A base problem, its plan's variables, and the scenario for a number.
struct OneNumberScenarios {
  OwnedProblem base;                                      ///< for the nominal number
  std::vector<Index> first_stage;                         ///< the plan
  std::function<ScenarioNumbers(double number)> numbers;  ///< of the scenario for that number

  /// Returns the scenarios of these numbers, in their order. This object must outlive the result.
  [[nodiscard]] ScenarioProblem scenarios(std::vector<double> of_numbers) const;
};

/// The published rocket. States and inputs are the plan, 358 variables. The number is the trigger's altitude
/// in m, nominally 3.9. Above about 5 there is no plan.
[[nodiscard]] OneNumberScenarios rocket_by_altitude();

/// The hopper. The body's trajectory and the leg's forces are the plan; the foot and the contact belong to
/// each scenario. The number is the friction μ.
[[nodiscard]] OneNumberScenarios hopper_by_friction(const HopperParameters& parameters = {});

}  // namespace marble::examples
