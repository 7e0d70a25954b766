// Draws lines over two axes as SVG inside a page; the page's style defines the colours.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace marble::load {

enum class Scale {
  linear,
  logarithmic,
  nines,  ///< for parts in [0, 1): 0, 90 %, 99 %, 99.9 % at equal distances
};

struct Axis {
  std::string title;
  Scale scale = Scale::linear;
};

struct Series {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< points that an axis cannot show are dropped
  bool line = true;
  bool marks = false;
};

/// Returns an <svg> element of 760 × 360 units, with axes, a grid, a legend and up to six series in their
/// colours.
[[nodiscard]] std::string svg_plot(const std::string& title, const Axis& x, const Axis& y,
                                   const std::vector<Series>& series);

/// Escapes text for HTML or SVG.
[[nodiscard]] std::string escaped(const std::string& text);

}  // namespace marble::load
