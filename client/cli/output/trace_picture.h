// Draws a trace as a picture.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/gnuplot.h"
#include "marble/progress.h"

namespace marble::cli {

/// Returns gnuplot's commands, data included, which write the picture to standard output: logarithmic columns
/// on one panel, the others on one below, along x, with marks where factorizations were repeated.
[[nodiscard]] std::string trace_picture(std::span<const Progress> rows, const ProgressColumn& x,
                                        std::span<const ProgressColumn* const> columns, PictureFormat format,
                                        const std::string& title);

}  // namespace marble::cli
