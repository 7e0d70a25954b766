// Lines over two axes, as SVG inside a page: colours come from the page's style.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace marble::load {

enum class Scale {
  linear,
  logarithmic,
  nines,  ///< of parts in [0, 1): 0, 90 %, 99 %, 99.9 % at equal distances
};

struct Axis {
  std::string title;
  Scale scale = Scale::linear;
};

struct Series {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< those an axis cannot show are left out
  bool line = true;
  bool marks = false;
};

/// An <svg> element of 760 × 360 units, with axes, a grid, a legend and up to six series in their colours.
[[nodiscard]] std::string svg_plot(const std::string& title, const Axis& x, const Axis& y,
                                   const std::vector<Series>& series);

/// Text inside HTML or SVG.
[[nodiscard]] std::string escaped(const std::string& text);

}  // namespace marble::load
