// The same problem in other units.
#pragma once

#include <functional>

#include "marble/problem.h"

namespace marble::testing {

struct OtherUnits {
  /// What to multiply by: of each variable its column (the new variable is the old one by this), of each row
  /// the row with its constant. Called once for each, in their order.
  std::function<double()> variable = [] { return 1.0; };
  std::function<double()> row = [] { return 1.0; };
  double cost = 1.0;
};

struct Converted {
  OwnedProblem problem;
  std::vector<double> variables;  ///< n: the old z is this times the new one
};
[[nodiscard]] Converted convert(OwnedProblem problem, const OtherUnits& units);

}  // namespace marble::testing
