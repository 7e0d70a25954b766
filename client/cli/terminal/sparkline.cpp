#include "terminal/sparkline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace marble::cli {
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
