#include "peers/performance_profile.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

namespace marble::suite {
namespace {

constexpr double kLeft = 60, kTop = 30, kWidth = 560, kHeight = 320, kDecades = 3;
constexpr const char* kColors[] = {"#0b6e4f", "#c1666b", "#48639c", "#d4a017", "#7d5ba6", "#333333"};

double x_of(double factor) { return kLeft + kWidth * std::clamp(std::log10(factor) / kDecades, 0.0, 1.0); }
double y_of(double share) { return kTop + kHeight * (1.0 - share); }

std::string curve(std::vector<double> factors, const char* color) {
  std::ranges::sort(factors);
  std::ostringstream path;
  path << "<path fill='none' stroke='" << color << "' stroke-width='2' d='M" << kLeft << ' ' << y_of(0.0);
  for (std::size_t solved = 0; solved < factors.size() && std::isfinite(factors[solved]); ++solved) {
    path << " H" << x_of(factors[solved]) << " V"
         << y_of(static_cast<double>(solved + 1) / static_cast<double>(factors.size()));
  }
  path << " H" << kLeft + kWidth << "'/>\n";
  return path.str();
}

}  // namespace

void draw_performance_profile(const Times& times, const std::filesystem::path& file) {
  if (times.empty()) return;
  const std::size_t problems = times.begin()->second.size();
  std::vector<double> best(problems, std::numeric_limits<double>::infinity());
  for (const auto& [solver, all] : times) {
    for (std::size_t i = 0; i < problems; ++i) best[i] = std::min(best[i], all[i]);
  }
  std::ofstream out(file);
  out << "<svg xmlns='http://www.w3.org/2000/svg' width='860' height='400' font-family='sans-serif' "
         "font-size='12'>\n"
      << "<rect width='860' height='400' fill='white'/>\n";
  for (int decade = 0; decade <= kDecades; ++decade) {
    const double x = x_of(std::pow(10.0, decade));
    out << "<path stroke='#ddd' d='M" << x << ' ' << kTop << " V" << kTop + kHeight << "'/><text x='" << x
        << "' y='" << kTop + kHeight + 18 << "' text-anchor='middle'>" << std::pow(10.0, decade)
        << "</text>\n";
  }
  for (int tenth = 0; tenth <= 10; tenth += 2) {
    out << "<path stroke='#ddd' d='M" << kLeft << ' ' << y_of(0.1 * tenth) << " H" << kLeft + kWidth
        << "'/><text x='" << kLeft - 8 << "' y='" << y_of(0.1 * tenth) + 4 << "' text-anchor='end'>"
        << 10 * tenth << "%</text>\n";
  }
  out << "<text x='" << kLeft + kWidth / 2
      << "' y='390' text-anchor='middle'>time over the best solver's time</text>\n"
      << "<text x='" << kLeft << "' y='18'>share of " << problems << " problems solved</text>\n";
  std::size_t number = 0;
  for (const auto& [solver, all] : times) {
    std::vector<double> factors(problems);
    for (std::size_t i = 0; i < problems; ++i) factors[i] = std::isfinite(all[i]) ? all[i] / best[i] : all[i];
    const char* color = kColors[number % std::size(kColors)];
    out << curve(factors, color) << "<text fill='" << color << "' x='" << kLeft + kWidth + 15 << "' y='"
        << kTop + 15 + 18.0 * static_cast<double>(number) << "'>" << solver << "</text>\n";
    ++number;
  }
  out << "</svg>\n";
}

}  // namespace marble::suite
