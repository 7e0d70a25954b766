// Curves in a terminal: dots of Braille where there is Unicode, letters elsewhere.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "terminal/line.h"

namespace marble::cli {

/// One curve. Of what is no number, or has no place on a log axis, nothing is drawn.
struct Curve {
  std::string name;
  char mark = '*';  ///< what draws it where there is no Unicode
  Style style = Style::series_1;
  std::vector<double> values;  ///< as many as there are x
  /// On a log axis: 0 means that the constraint holds exactly, and is drawn on a row of its own at the
  /// bottom; else it means that there is no value.
  bool zero_counts = false;
};

struct PlotLook {
  Size size;  ///< of everything, legend and axes included
  bool log = true;
  bool unicode = true;
  std::string x_name = "iteration";
};

/// At most size.height lines of at most size.width columns: the legend, the curves with their axis on the
/// left, and the range of x. Empty where that is too little space, below 24 x 5.
[[nodiscard]] Lines terminal_plot(std::span<const double> x, std::span<const Curve> curves,
                                  const PlotLook& look);

}  // namespace marble::cli
