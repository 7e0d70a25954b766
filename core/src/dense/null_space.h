// The stationary point on rows held at zero, by an orthogonal factorization of these rows and residuals as if
// in twice the precision: as exact as doubles can represent it while the condition number of the rows is well
// below 1/eps.
#pragma once

#include <vector>

#include "dense/row_access.h"

namespace marble {

struct StationaryPoint {
  Vector z;
  Vector multipliers;  ///< of the rows held, in their order: Qz + g + Σ λ row = 0
};

/// From a point near it. False if Q is flat or has negative curvature on the rows, or the rows depend on each
/// other: nothing has converged then.
[[nodiscard]] bool refine(const ScaledProblem& problem, const std::vector<Index>& held,
                          StationaryPoint& point);

}  // namespace marble
