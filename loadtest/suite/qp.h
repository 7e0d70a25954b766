// Convex QPs without pairs, against solvers made for them.
#pragma once

#include "families.h"

namespace marble::suite {

/// Random sparse QPs, linear MPC and obstacle problems.
void qp(const Settings& settings);

}  // namespace marble::suite
