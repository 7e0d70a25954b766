// Plots curves in a terminal: Braille dots with Unicode, letters otherwise.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "terminal/line.h"

namespace marble::cli {

/// One curve. Values that are NaN, or have no place on a log axis, are not drawn.
struct Curve {
  std::string name;
  char mark = '*';  ///< its letter without Unicode
  Style style = Style::series_1;
  std::vector<double> values;  ///< one per x
  /// On a log axis: true if 0 means that the constraint holds exactly; it is drawn on its own row at the
  /// bottom. False if 0 means that there is no value.
  bool zero_counts = false;
};

struct PlotLook {
  Size size;  ///< total size, including legend and axes
  bool log = true;
  bool unicode = true;
  std::string x_name = "iteration";
};

/// Returns at most size.height lines of at most size.width columns: the legend, the curves with their axis on
/// the left, and the range of x. Empty below 24 x 5.
[[nodiscard]] Lines terminal_plot(std::span<const double> x, std::span<const Curve> curves,
                                  const PlotLook& look);

// Draws numbers as a row of small bars on a log scale.

/// Returns at most `width` columns, oldest value first; with more values than columns each column shows the
/// largest of its share. The scale covers the range of the values, but at least two decades. Zero and
/// negative values have height zero; NaN is a question mark. Uses blocks if `unicode`, else ASCII.
[[nodiscard]] std::string sparkline(std::span<const double> values, int width, bool unicode);

}  // namespace marble::cli
