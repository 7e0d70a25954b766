#include "marble/scenario_examples.h"

#include <utility>

#include "marble/published_examples.h"

namespace marble::examples {
namespace {

constexpr double kNominalAltitude = 1.3 * 3.0;

}  // namespace

ScenarioProblem OneNumberScenarios::scenarios(std::vector<double> of_numbers) const {
  ScenarioProblem problem;
  problem.base = base.view();
  problem.first_stage = first_stage;
  problem.scenarios = static_cast<std::int64_t>(of_numbers.size());
  problem.sample = [this, all = std::move(of_numbers)](std::int64_t i) -> Expected<ScenarioNumbers> {
    return numbers(all[static_cast<std::size_t>(i)]);
  };
  return problem;
}

OneNumberScenarios rocket_by_altitude() {
  OneNumberScenarios result;
  result.base = published_rocket();
  // A step has 7 states, 8 variables of the trigger and, except in the last step, 2 inputs.
  const auto variables = static_cast<Index>(result.base.g.size());
  for (Index first = 0; first < variables; first += 17) {
    for (Index i = 0; i < 17 && first + i < variables; ++i)
      if (i < 7 || i >= 15) result.first_stage.push_back(first + i);
  }
  std::vector<std::size_t> rows;
  const OwnedProblem other = published_rocket(kNominalAltitude + 1.0);
  for (std::size_t row = 0; row < other.b.size(); ++row)
    if (other.b[row] != result.base.b[row]) rows.push_back(row);
  result.numbers = [b = result.base.b, rows](double altitude) {
    ScenarioNumbers numbers;
    numbers.b = b;
    for (const std::size_t row : rows) numbers.b[row] = -altitude;
    return numbers;
  };
  return result;
}

OneNumberScenarios hopper_by_friction(const HopperParameters& parameters) {
  OneNumberScenarios result;
  result.base = hopper(parameters);
  for (int step = 0; step < parameters.steps; ++step)
    for (const int i : {kBodyX, kBodyZ, kBodyVx, kBodyVz, kForceX, kForceZ})
      result.first_stage.push_back(hopper_index(step, i));
  result.numbers = [parameters](double friction) {
    HopperParameters own = parameters;
    own.friction = friction;
    ScenarioNumbers numbers;
    numbers.C = hopper(own).C.values;
    return numbers;
  };
  return result;
}

}  // namespace marble::examples
