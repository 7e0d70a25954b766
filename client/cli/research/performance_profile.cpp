#include "research/performance_profile.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

namespace marble::cli {
namespace {

constexpr double kShownFactors = 10.0;  // at least, on the axis

double share(int count, int of) { return of > 0 ? static_cast<double>(count) / of : 0.0; }

std::string sentence(const PerformanceProfile::Curve& curve, int problems) {
  char text[200];
  if (curve.factors.empty()) {
    std::snprintf(text, sizeof text, " solves none of %d problems.\n", problems);
  } else {
    std::snprintf(
        text, sizeof text,
        " is the fastest on %d of %d problems (%.0f %%), at worst %.1f times slower than the fastest, and "
        "solves %zu.\n",
        curve.fastest, problems, 100.0 * share(curve.fastest, problems), curve.factors.back(),
        curve.factors.size());
  }
  return curve.name + text;
}

}  // namespace

PerformanceProfile::PerformanceProfile(const Times& times) {
  if (!times.empty()) problems_ = static_cast<int>(times.front().second.size());
  std::vector<double> best(static_cast<std::size_t>(problems_), std::numeric_limits<double>::infinity());
  for (const auto& [name, all] : times) {
    for (std::size_t i = 0; i < best.size(); ++i) best[i] = std::min(best[i], all[i]);
  }
  for (const auto& [name, all] : times) {
    Curve curve{name, {}, 0};
    for (std::size_t i = 0; i < best.size(); ++i) {
      if (!std::isfinite(all[i])) continue;
      curve.factors.push_back(best[i] > 0.0 ? all[i] / best[i] : 1.0);
      curve.fastest += all[i] == best[i];
    }
    std::ranges::sort(curve.factors);
    curves_.push_back(std::move(curve));
  }
}

int PerformanceProfile::Curve::within(double factor) const {
  return static_cast<int>(std::ranges::upper_bound(factors, factor) - factors.begin());
}

std::string PerformanceProfile::sentences() const {
  std::string text;
  for (const Curve& curve : curves_) text += sentence(curve, problems_);
  return text;
}

std::string PerformanceProfile::csv() const {
  std::set<double> factors = {1.0};
  std::string text = "factor";
  for (const Curve& curve : curves_) {
    factors.insert(curve.factors.begin(), curve.factors.end());
    text += "," + curve.name;
  }
  for (const double factor : factors) {
    text += "\n" + gnuplot_number(factor);
    for (const Curve& curve : curves_) text += "," + gnuplot_number(share(curve.within(factor), problems_));
  }
  return text + "\n";
}

std::string PerformanceProfile::picture(PictureFormat format, const std::string& title) const {
  double last = kShownFactors;
  for (const Curve& curve : curves_) {
    if (!curve.factors.empty()) last = std::max(last, curve.factors.back());
  }
  last = std::pow(10.0, std::ceil(std::log10(last)));
  std::string text = gnuplot_style(format), plots;
  for (std::size_t c = 0; c < curves_.size(); ++c) {
    const Curve& curve = curves_[c];
    const std::string block = "$curve" + std::to_string(c);
    text += block + " << END_OF_CURVE\n1 0\n";
    for (std::size_t i = 0; i < curve.factors.size(); ++i)
      text += gnuplot_number(curve.factors[i]) + " " +
              gnuplot_number(share(static_cast<int>(i) + 1, problems_)) + "\n";
    text += gnuplot_number(last) + " " +
            gnuplot_number(share(static_cast<int>(curve.factors.size()), problems_)) + "\nEND_OF_CURVE\n";
    plots += (c > 0 ? ", \\\n  " : "") + block + " using 1:($2*100) with steps linewidth 2 linecolor " +
             gnuplot_colour(c) + " title '" + gnuplot_text(curve.name) + "'";
  }
  text += "set title '" + gnuplot_text(title) +
          "' noenhanced\nset logscale x 10\nset xrange [1:" + gnuplot_number(last) +
          "]\nset yrange [0:102]\n" +
          "set xlabel 'time over the time of the fastest'\nset ylabel 'problems solved, percent of " +
          std::to_string(problems_) + "'\n";
  return text + "plot " + plots + "\n";
}

}  // namespace marble::cli
