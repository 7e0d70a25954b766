#include "composite/lift.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace marble {
namespace {

struct Vector {
  std::vector<double> Solution::*values;
  const Split& split;
  bool multipliers;
};

template <class Visit>
void each_vector(const Stages& stages, const Visit& visit) {
  visit(Vector{&Solution::z, stages.variables, false});
  visit(Vector{&Solution::equality_multipliers, stages.equalities, true});
  visit(Vector{&Solution::inequality_multipliers, stages.inequalities, true});
  visit(Vector{&Solution::complementarity_multipliers_L, stages.pairs, true});
  visit(Vector{&Solution::complementarity_multipliers_R, stages.pairs, true});
}

double distance_squared(std::span<const double> a, std::span<const double> b, std::span<const double> base) {
  if (a.empty() && b.empty()) return 0.0;
  if (a.empty()) a = base;
  if (b.empty()) b = base;
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

}  // namespace

Solution scenario_part(const Stages& stages, const Solution& answer, std::size_t scenario, double weight) {
  Solution part;
  each_vector(stages, [&](const Vector& vector) {
    const std::size_t size = vector.split.second.size();
    const auto first = (answer.*vector.values).begin() +
                       static_cast<std::ptrdiff_t>(vector.split.first.size() + scenario * size);
    std::vector<double>& values = part.*vector.values;
    values.assign(first, first + static_cast<std::ptrdiff_t>(size));
    if (vector.multipliers)  // a weight may underflow, and the quotient then overflow
      for (double& value : values) value = std::isfinite(value / weight) ? value / weight : 0.0;
  });
  part.reference_objective = std::numeric_limits<double>::infinity();
  return part;
}

Solution lifted(const Stages& stages, const Solution& answer, std::span<const Solution* const> parts,
                std::span<const double> weights) {
  Solution result;
  each_vector(stages, [&](const Vector& vector) {
    std::vector<double>& values = result.*vector.values;
    const std::vector<double>& old = answer.*vector.values;
    values.reserve(vector.split.assembled(parts.size()));
    values.assign(old.begin(), old.begin() + static_cast<std::ptrdiff_t>(vector.split.first.size()));
    for (std::size_t s = 0; s < parts.size(); ++s)
      for (const double value : parts[s]->*vector.values)
        values.push_back(vector.multipliers ? weights[s] * value : value);
  });
  result.reference_objective = std::numeric_limits<double>::infinity();
  return result;
}

std::size_t nearest(const Stages& stages, const ScenarioNumbers& scenario,
                    std::span<const ScenarioNumbers> known, Checkpoint& checkpoint) {
  const ProblemView& base = stages.base().view();
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t s = 0; s < known.size(); ++s) {
    double sum = 0.0;
    std::size_t numbers = 1;
#define MARBLE_VECTOR(letter, field)                                      \
  sum += distance_squared(scenario.letter, known[s].letter, base.letter); \
  numbers += std::max(scenario.letter.size(), known[s].letter.size());
#define MARBLE_MATRIX(letter, field, update, vector)                             \
  sum += distance_squared(scenario.letter, known[s].letter, base.letter.values); \
  numbers += std::max(scenario.letter.size(), known[s].letter.size());
#include "marble/contract.def"
    if (checkpoint.reached(static_cast<std::int64_t>(numbers))) break;
    if (sum < least) {
      least = sum;
      best = s;
    }
  }
  return best;
}

std::vector<double> normalized_weights(std::span<const ScenarioNumbers> scenarios) {
  double sum = 0.0;
  for (const ScenarioNumbers& scenario : scenarios) sum += scenario.weight;
  double unit = 1.0;  // 1 unless the sum overflows
  if (!std::isfinite(sum)) {
    for (const ScenarioNumbers& scenario : scenarios) unit = std::max(unit, scenario.weight);
    sum = 0.0;
    for (const ScenarioNumbers& scenario : scenarios) sum += scenario.weight / unit;
  }
  std::vector<double> weights;
  weights.reserve(scenarios.size());
  for (const ScenarioNumbers& scenario : scenarios) weights.push_back(scenario.weight / unit / sum);
  return weights;
}

}  // namespace marble
