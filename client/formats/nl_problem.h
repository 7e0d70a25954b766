// AMPL's .nl files, text or binary: those that are LCQPs.
#pragma once

#include <string>
#include <string_view>

#include "marble/problem_file.h"

namespace marble::formats {

/// A quadratic objective, linear constraints with bounds, linear complementarity conditions ("complements"),
/// no integers. Everything else is refused with the reason. A maximum becomes the minimum of the negative.
/// Conditions on a variable with two bounds take two variables of their own, after the file's. What the file
/// says of suffixes and dual values is left out; its initial point is taken.
[[nodiscard]] Expected<ProblemFile> parse_nl(std::string_view content, const std::string& name);

}  // namespace marble::formats
