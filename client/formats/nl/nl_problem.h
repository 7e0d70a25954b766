// AMPL's .nl files, text or binary: those that are LCQPs.
#pragma once

#include <string>
#include <string_view>

#include "marble/problem_file.h"

namespace marble::formats {

/// A quadratic objective, linear constraints with bounds, linear complementarity conditions ("complements"),
/// no integers. Everything else is refused with the reason. A maximum becomes the minimum of the negative.
/// A condition is with regard to those bounds of its variable that its row names ("5 k i": k & 1 the lower, k
/// & 2 the upper one); other bounds stay bounds. One with regard to both takes two variables of its own,
/// after the file's. What the file says of suffixes and dual values is left out; its initial point is taken.
/// Memory is in proportion to the file's length (file_limits.h).
[[nodiscard]] Expected<ProblemFile> parse_nl(std::string_view content, const std::string& name);

}  // namespace marble::formats
