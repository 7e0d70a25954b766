// The numbers that were chosen, not derived; tuning.def defines each of them once.
#pragma once

namespace marble::nonlinear::tuning {

#define MARBLE_TUNING(type, name, value, unit, what, basis, why) inline constexpr type name = value;
#include "nonlinear/tuning.def"
#undef MARBLE_TUNING

}  // namespace marble::nonlinear::tuning
