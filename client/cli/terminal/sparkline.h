// Numbers as a row of little bars, on a log scale.
#pragma once

#include <span>
#include <string>

namespace marble::cli {

/// At most `width` columns, oldest value first; of more values than columns each column shows the largest of
/// its share. The scale goes over the values' own range, but at least two decades. Zero and less are a bar of
/// no height; what is no number is a question mark. Blocks where `unicode`, else ASCII.
[[nodiscard]] std::string sparkline(std::span<const double> values, int width, bool unicode);

}  // namespace marble::cli
