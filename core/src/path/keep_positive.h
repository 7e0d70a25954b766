// The longest step for which numbers stay positive.
#pragma once

#include <algorithm>

namespace marble {

/// Shortens `length` so that value + length · change is not negative; requires value > 0.
inline void keep_positive(double value, double change, double& length) {
  if (change < 0.0) length = std::min(length, -value / change);
}

}  // namespace marble
