// Compares the solver with QP solvers on convex QPs without pairs.
#pragma once

#include "families.h"

namespace marble::suite {

/// Runs random sparse QPs, linear MPC and obstacle problems.
void qp(const Settings& settings);

}  // namespace marble::suite
