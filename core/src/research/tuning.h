// The numbers that were chosen for the methods of others, beside those of the solver.
#pragma once

#include "model/tuning.h"

namespace marble::tuning {

#ifdef MARBLE_TUNABLE
#define MARBLE_TUNING(type, name, value, unit, what, basis, why) inline type name = value;
#else
#define MARBLE_TUNING(type, name, value, unit, what, basis, why) inline constexpr type name = value;
#endif
#include "research/tuning.def"
#undef MARBLE_TUNING

}  // namespace marble::tuning
