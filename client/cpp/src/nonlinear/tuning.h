// The numbers that were chosen, not derived; tuning.def defines each of them once.
#pragma once

#include "marble/options.h"

namespace marble::nonlinear::tuning {

#define MARBLE_TUNING(type, name, value, unit, what, basis, why) inline constexpr type name = value;
#include "nonlinear/tuning.def"
#undef MARBLE_TUNING

// The default tolerances of a solve.
/// KKT residual of a stationary solution, of the largest slope.
inline constexpr double solved_kkt = Options{}.stationarity_tolerance;
/// Curvature of the variables in an elastic step that only restores feasibility.
inline constexpr double proximal = Options{}.equality_tolerance;

}  // namespace marble::nonlinear::tuning
