// Converts a problem to other units.
#pragma once

#include <functional>

#include "marble/problem.h"

namespace marble::testing {

struct OtherUnits {
  /// Scale factors: of a variable's column (the new variable is the old one divided by it), of a row with its
  /// constant. Called once for each, in their order.
  std::function<double()> variable = [] { return 1.0; };
  std::function<double()> row = [] { return 1.0; };
  double cost = 1.0;
};

struct Converted {
  OwnedProblem problem;
  std::vector<double> variables;  ///< n: the factors from the new z to the old one
};
[[nodiscard]] Converted convert(OwnedProblem problem, const OtherUnits& units);

}  // namespace marble::testing
