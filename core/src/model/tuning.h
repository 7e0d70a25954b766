// The numbers that were chosen, not derived; tuning.def defines each of them once.
//
// They are constants. In the build of the core that loadtest/suite/tune links (MARBLE_TUNABLE) they are
// variables, so that a sweep can try other values without compiling. No other build does this.
#pragma once

#include <cstddef>
#include <cstdint>

namespace marble::tuning {

#ifdef MARBLE_TUNABLE
#define MARBLE_TUNED inline
#else
#define MARBLE_TUNED inline constexpr
#endif
// research/tuning.h uses it too.
#define MARBLE_TUNING(type, name, value, unit, what, basis, why) MARBLE_TUNED type name = value;
#include "model/tuning.def"

// Derived from these. A sweep does not change them.
/// Scaled: a point farther out than this left along a direction that nothing bounds; a δ above it is of no
/// use.
MARBLE_TUNED double runaway = 1.0 / rounding;
/// A scale factor stays within this of 1, and the curvature of a barrier below it: above the root of the
/// range that doubles resolve, rounding of a row times this is no multiplier.
MARBLE_TUNED double scale_range = 1.0 / zero;

}  // namespace marble::tuning
