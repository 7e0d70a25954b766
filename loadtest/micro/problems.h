// Provides the problems of the micro-benchmarks, by family and size.
#pragma once

#include "marble/examples.h"

namespace marble::micro {

inline OwnedProblem hopper(std::int64_t steps) {
  examples::HopperParameters parameters;
  parameters.steps = static_cast<int>(steps);
  return examples::hopper(parameters);
}

inline OwnedProblem rocket(std::int64_t steps) {
  examples::RocketParameters parameters;
  parameters.steps = static_cast<int>(steps);
  return examples::rocket(parameters);
}

inline OwnedProblem gates(std::int64_t steps) {
  examples::GatesParameters parameters;
  parameters.steps = static_cast<int>(steps);
  return examples::gates(parameters);
}

/// A fifth of the variables belongs to the upper level.
inline OwnedProblem qpec(std::int64_t variables) {
  examples::QpecParameters parameters;
  parameters.upper_variables = static_cast<Index>(variables) / 5;
  parameters.lower_variables = static_cast<Index>(variables) - parameters.upper_variables;
  return examples::qpec(parameters, 1);
}

}  // namespace marble::micro
