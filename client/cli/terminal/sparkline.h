// Draws numbers as a row of small bars on a log scale.
#pragma once

#include <span>
#include <string>

namespace marble::cli {

/// Returns at most `width` columns, oldest value first; with more values than columns each column shows the
/// largest of its share. The scale covers the range of the values, but at least two decades. Zero and
/// negative values have height zero; NaN is a question mark. Uses blocks if `unicode`, else ASCII.
[[nodiscard]] std::string sparkline(std::span<const double> values, int width, bool unicode);

}  // namespace marble::cli
