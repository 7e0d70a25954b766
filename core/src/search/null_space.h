// Computes the stationary point on rows held at zero, with an orthogonal factorization of these rows and
// residuals as if in twice the precision. The result is as exact as doubles can represent it while the
// condition number of the rows is well below 1/eps.
#pragma once

#include <vector>

#include "search/row_access.h"

namespace marble {

struct StationaryPoint {
  Vector z;
  Vector multipliers;  ///< of the held rows, in their order: Qz + g + Σ λ row = 0
};

/// Refines a nearby point. Returns false if it did not converge, because Q is flat or has negative curvature
/// on the rows, or the rows are dependent.
[[nodiscard]] bool refine(const ScaledProblem& problem, const std::vector<Index>& held,
                          StationaryPoint& point);

}  // namespace marble
