#include "terminal/terminal_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <vector>

namespace marble::cli {
namespace {

constexpr int kLeastWidth = 24, kLeastHeight = 5;
constexpr int kMostDecades = 24;  // below that is rounding
constexpr int kLabelEvery = 3;    // rows

std::string label_text(double value, bool log) {
  char text[32];
  std::snprintf(text, sizeof text, log ? "%.0e" : "%.5g", value);
  return text;
}

// The y axis: maps values to heights in [0, 1], and back for its labels.
struct Axis {
  bool log = false;
  double low = 0.0, high = 1.0;  // of the logarithm, on a log axis
  bool has_zero = false;         // zero has its own row below the others

  [[nodiscard]] std::optional<double> height(double value) const {
    if (!std::isfinite(value) || (log && value <= 0.0)) return {};
    const double shown = log ? std::log10(value) : value;
    return std::clamp((shown - low) / (high - low), 0.0, 1.0);
  }
  [[nodiscard]] double value_at(double height) const {
    const double shown = low + height * (high - low);
    return log ? std::pow(10.0, shown) : shown;
  }
};

Axis axis_of(std::span<const Curve> curves, bool log) {
  Axis axis{log, std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const Curve& curve : curves) {
    for (const double value : curve.values) {
      if (log && value == 0.0 && curve.zero_counts) axis.has_zero = true;
      if (!std::isfinite(value) || (log && value <= 0.0)) continue;
      const double shown = log ? std::log10(value) : value;
      axis.low = std::min(axis.low, shown);
      axis.high = std::max(axis.high, shown);
    }
  }
  if (axis.low > axis.high) axis.low = log ? -1.0 : 0.0, axis.high = log ? 0.0 : 1.0;  // nothing to draw
  if (log) {
    axis.high = std::ceil(axis.high);
    axis.low = std::max(std::floor(axis.low), axis.high - kMostDecades);
  }
  if (axis.low == axis.high) {
    const double margin = log ? 1.0 : std::max(1.0, std::abs(axis.low)) * 1e-3;
    axis.low -= margin;
    axis.high += margin;
  }
  return axis;
}

// Cells with dots: 2 x 4 Braille dots each, or one letter.
class Canvas {
 public:
  Canvas(int width, int height, bool unicode)
      : width_(width), height_(height), unicode_(unicode), cells_(index(height, 0)) {}

  [[nodiscard]] int dots_across() const { return width_ * (unicode_ ? 2 : 1); }
  [[nodiscard]] int dots_down(int rows) const { return rows * (unicode_ ? 4 : 1); }

  void dot(int x, int y, const Curve& curve) {
    const int column = unicode_ ? x / 2 : x;
    const int row = unicode_ ? y / 4 : y;
    if (column < 0 || column >= width_ || row < 0 || row >= height_) return;
    Cell& cell = cells_[index(row, column)];
    constexpr unsigned kBits[4][2] = {{0x01, 0x08}, {0x02, 0x10}, {0x04, 0x20}, {0x40, 0x80}};
    cell.dots |= unicode_ ? kBits[y % 4][x % 2] : 1U;
    cell.mark = curve.mark;
    cell.style = curve.style;
  }

  void stroke(int x0, int y0, int x1, int y1, const Curve& curve) {
    const int steps = std::max({std::abs(x1 - x0), std::abs(y1 - y0), 1});
    for (int i = 0; i <= steps; ++i) dot(x0 + (x1 - x0) * i / steps, y0 + (y1 - y0) * i / steps, curve);
  }

  void add_row(int row, Line& line) const {
    for (int column = 0; column < width_; ++column) {
      const Cell& cell = cells_[index(row, column)];
      if (cell.dots == 0) {
        line.add(" ", Style::plain);
      } else {
        line.add(unicode_ ? braille(cell.dots) : std::string(1, cell.mark), cell.style);
      }
    }
  }

 private:
  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(column);
  }

  struct Cell {
    unsigned dots = 0;
    char mark = ' ';
    Style style = Style::plain;
  };
  static std::string braille(unsigned dots) {  // U+2800 + dots
    return {'\xe2', static_cast<char>(0xa0 + (dots >> 6)), static_cast<char>(0x80 + (dots & 0x3f))};
  }

  int width_, height_;
  bool unicode_;
  std::vector<Cell> cells_;
};

struct Frame {
  Axis axis;
  double x_low = 0.0, x_high = 1.0;
  int rows = 0;  // without the row of zero
};

void draw(const Curve& curve, std::span<const double> x, const Frame& frame, Canvas& canvas) {
  const int across = canvas.dots_across() - 1;
  const int down = canvas.dots_down(frame.rows) - 1;
  bool joined = false;
  int last_x = 0, last_y = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double along = frame.x_high > frame.x_low ? (x[i] - frame.x_low) / (frame.x_high - frame.x_low) : 0;
    const int dot_x = static_cast<int>(std::lround(std::clamp(along, 0.0, 1.0) * across));
    const auto height = frame.axis.height(curve.values[i]);
    if (!height) {
      const bool zero = frame.axis.has_zero && curve.zero_counts && curve.values[i] == 0.0;
      if (zero) canvas.dot(dot_x, canvas.dots_down(frame.rows), curve);
      joined = false;
      continue;
    }
    const int dot_y = static_cast<int>(std::lround((1.0 - *height) * down));
    canvas.stroke(joined ? last_x : dot_x, joined ? last_y : dot_y, dot_x, dot_y, curve);
    joined = true;
    last_x = dot_x;
    last_y = dot_y;
  }
}

Line legend(std::span<const Curve> curves, bool unicode) {
  Line line;
  for (const Curve& curve : curves) {
    if (line.width() > 0) line.add("  ");
    line.add((unicode ? std::string("■") : std::string(1, curve.mark)) + " " + curve.name, curve.style);
  }
  return line;
}

std::vector<std::string> labels(const Frame& frame) {
  std::vector<std::string> result(static_cast<std::size_t>(frame.rows));
  for (int row = 0; row < frame.rows; ++row) {
    const bool last = row == frame.rows - 1;
    if ((row % kLabelEvery != 0 || frame.rows - 1 - row < 2) && !last) continue;
    const double height = 1.0 - static_cast<double>(row) / std::max(1, frame.rows - 1);
    result[static_cast<std::size_t>(row)] = label_text(frame.axis.value_at(height), frame.axis.log);
  }
  if (frame.axis.has_zero) result.emplace_back("0");
  return result;
}

Line x_axis(const Frame& frame, const std::string& name, int margin, int width) {
  char low[32], high[32];
  std::snprintf(low, sizeof low, "%.6g", frame.x_low);
  std::snprintf(high, sizeof high, "%.6g", frame.x_high);
  Line line;
  line.pad_to(margin);
  line.add(low, Style::faint);
  line.pad_to(margin + (width - margin - columns_of(name)) / 2);
  line.add(name, Style::faint);
  line.pad_to(width - columns_of(high));
  line.add(high, Style::faint);
  return line;
}

}  // namespace

Lines terminal_plot(std::span<const double> x, std::span<const Curve> curves, const PlotLook& look) {
  if (look.size.width < kLeastWidth || look.size.height < kLeastHeight || x.empty()) return {};
  Frame frame{axis_of(curves, look.log)};
  const auto [low, high] = std::minmax_element(x.begin(), x.end());
  frame.x_low = *low;
  frame.x_high = *high;
  const int rows = look.size.height - 2;  // the legend and the x axis take one each
  frame.rows = rows - (frame.axis.has_zero ? 1 : 0);
  const std::vector<std::string> left = labels(frame);
  int margin = 0;
  for (const std::string& label : left) margin = std::max(margin, columns_of(label));
  margin += 1;

  Canvas canvas(look.size.width - margin - 1, rows, look.unicode);
  for (const Curve& curve : curves) draw(curve, x, frame, canvas);
  Lines lines{legend(curves, look.unicode)};
  for (int row = 0; row < rows; ++row) {
    const std::string& label = left[static_cast<std::size_t>(row)];
    Line line;
    line.pad_to(margin - 1 - columns_of(label));
    line.add(label + (look.unicode ? " │" : " |"), Style::faint);
    canvas.add_row(row, line);
    lines.push_back(std::move(line));
  }
  lines.push_back(x_axis(frame, look.x_name, margin, look.size.width));
  for (Line& line : lines) line.cut_to(look.size.width);
  return lines;
}

namespace {

constexpr std::array kBlocks = {"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array kAscii = {"_", ".", ":", "-", "=", "+", "*", "#"};
constexpr double kLeastDecades = 2.0;

// Like std::max, but NaN wins: it must not be hidden.
double worse_of(double a, double b) { return std::isnan(a) || a > b ? a : b; }

std::vector<double> resampled(std::span<const double> values, std::size_t width) {
  const std::size_t columns = std::min(values.size(), width);
  std::vector<double> result;
  for (std::size_t i = 0; i < columns; ++i) {
    const std::size_t begin = i * values.size() / columns;
    const std::size_t end = (i + 1) * values.size() / columns;
    double worst = values[begin];
    for (std::size_t j = begin + 1; j < end; ++j) worst = worse_of(worst, values[j]);
    result.push_back(worst);
  }
  return result;
}

}  // namespace

std::string sparkline(std::span<const double> values, int width, bool unicode) {
  if (width <= 0 || values.empty()) return "";
  const std::vector<double> columns = resampled(values, static_cast<std::size_t>(width));
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : columns) {
    if (!std::isfinite(value) || value <= 0.0) continue;
    low = std::min(low, std::log10(value));
    high = std::max(high, std::log10(value));
  }
  const double decades = std::max(high - low, kLeastDecades);
  const auto& bars = unicode ? kBlocks : kAscii;
  std::string text;
  for (const double value : columns) {
    if (!std::isfinite(value)) {
      text += '?';
      continue;
    }
    const double height = value > 0.0 ? (std::log10(value) - high + decades) / decades : 0.0;
    const double level = std::round(height * static_cast<double>(bars.size() - 1));
    text += bars[static_cast<std::size_t>(std::clamp(level, 0.0, static_cast<double>(bars.size() - 1)))];
  }
  return text;
}

}  // namespace marble::cli
