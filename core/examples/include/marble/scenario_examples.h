// Plans for worlds that differ by one number: the rocket by the altitude of its trigger, the hopper by the
// ground's friction.
#pragma once

#include <functional>
#include <vector>

#include "marble/composite/scenarios.h"
#include "marble/examples.h"

namespace marble::examples {

/// A base problem, its plan's variables, and the world of a number.
struct OneNumberWorlds {
  OwnedProblem base;                                      ///< of the nominal number
  std::vector<Index> first_stage;                         ///< the plan
  std::function<ScenarioNumbers(double number)> numbers;  ///< of that world

  /// Worlds of these numbers, in their order. This object must outlive it.
  [[nodiscard]] ScenarioProblem worlds(std::vector<double> of_numbers) const;
};

/// The published rocket: states and inputs are the plan, 358 variables; the number is the trigger's
/// altitude in m, nominally 3.9. Above about 5 there is no plan.
[[nodiscard]] OneNumberWorlds rocket_by_altitude();

/// The hopper: the body's way and the leg's forces are the plan, the foot and the contact are each world's
/// own; the number is the friction μ.
[[nodiscard]] OneNumberWorlds hopper_by_friction(const HopperParameters& parameters = {});

}  // namespace marble::examples
