#include "report/svg_plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace marble::load {
namespace {

constexpr double kWidth = 760, kHeight = 360;
constexpr double kLeft = 76, kRight = 16, kTop = 36, kBottom = 56;
constexpr double kMostNines = 5.0;

// Maps a value to its position on an axis: from 0 to 1.
class Ruler {
 public:
  Ruler(const Axis& axis, const std::vector<Series>& series, bool is_x) : scale_(axis.scale) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Series& s : series) {
      for (const auto& [x, y] : s.points) {
        const double value = is_x ? x : y;
        if (!shows(value)) continue;
        low = std::min(low, position(value));
        high = std::max(high, position(value));
      }
    }
    if (!(low <= high)) low = 0.0, high = 1.0;
    if (scale_ == Scale::linear) {
      low = std::min(low, 0.0);
      step_ = nice_step((high > low ? high - low : 1.0) / 6.0);
      low = step_ * std::floor(low / step_);
      high = step_ * std::ceil(high / step_ + 1e-9);
    } else {
      low = std::floor(low);
      high = std::max(std::ceil(high), low + 1.0);
    }
    low_ = low;
    high_ = high > low ? high : low + 1.0;
  }

  [[nodiscard]] bool shows(double value) const {
    return std::isfinite(value) && (scale_ != Scale::logarithmic || value > 0.0);
  }
  [[nodiscard]] double operator()(double value) const { return (position(value) - low_) / (high_ - low_); }

  [[nodiscard]] std::vector<std::pair<double, std::string>> ticks() const {
    std::vector<std::pair<double, std::string>> result;
    if (scale_ == Scale::linear) {
      for (double v = low_; v <= high_ + 0.5 * step_; v += step_) result.emplace_back(v, number(v));
    } else if (scale_ == Scale::logarithmic) {
      for (double p = low_; p <= high_; ++p)
        result.emplace_back(std::pow(10.0, p), number(std::pow(10.0, p)));
    } else {
      for (double p = low_; p <= high_; ++p) {
        const double part = 1.0 - std::pow(10.0, -p);
        result.emplace_back(part, number(100.0 * part) + " %");
      }
    }
    return result;
  }

 private:
  [[nodiscard]] double position(double value) const {
    if (scale_ == Scale::logarithmic) return std::log10(value);
    if (scale_ == Scale::nines) return std::min(kMostNines, -std::log10(std::max(1e-9, 1.0 - value)));
    return value;
  }
  static double nice_step(double rough) {
    const double power = std::pow(10.0, std::floor(std::log10(rough)));
    for (const double factor : {1.0, 2.0, 5.0}) {
      if (factor * power >= rough) return factor * power;
    }
    return 10.0 * power;
  }
  static std::string number(double value) {
    std::ostringstream text;
    text.precision(7);
    text << (std::abs(value) < 1e-12 ? 0.0 : value);
    return text.str();
  }

  Scale scale_;
  double low_ = 0.0, high_ = 1.0, step_ = 1.0;
};

class Drawing {
 public:
  Drawing(const Axis& x, const Axis& y, const std::vector<Series>& series)
      : rule_x_(x, series, true), rule_y_(y, series, false) {
    out_.setf(std::ios::fixed);
    out_.precision(1);
  }

  void frame(const std::string& title, const Axis& x, const Axis& y) {
    out_ << "<svg viewBox=\"0 0 " << kWidth << ' ' << kHeight << "\" role=\"img\" aria-label=\""
         << escaped(title) << "\">\n<text class=\"title\" x=\"" << kLeft << "\" y=\"18\">" << escaped(title)
         << "</text>\n";
    for (const auto& [value, label] : rule_x_.ticks()) {
      line("grid", at_x(value), kTop, at_x(value), kHeight - kBottom);
      text("tick", at_x(value), kHeight - kBottom + 16, "middle", label);
    }
    for (const auto& [value, label] : rule_y_.ticks()) {
      line("grid", kLeft, at_y(value), kWidth - kRight, at_y(value));
      text("tick", kLeft - 6, at_y(value) + 4, "end", label);
    }
    text("axis", (kLeft + kWidth - kRight) / 2, kHeight - 26, "middle", x.title);
    out_ << "<text class=\"axis\" text-anchor=\"middle\" transform=\"translate(14,"
         << (kTop + kHeight - kBottom) / 2 << ") rotate(-90)\">" << escaped(y.title) << "</text>\n";
  }

  void draw(const Series& series, std::size_t number) {
    std::vector<std::pair<double, double>> shown;
    for (const auto& [x, y] : series.points) {
      if (rule_x_.shows(x) && rule_y_.shows(y)) shown.emplace_back(at_x(x), at_y(y));
    }
    if (series.line && !shown.empty()) {
      out_ << "<polyline class=\"s" << number << "\" points=\"";
      for (const auto& [x, y] : shown) out_ << x << ',' << y << ' ';
      out_ << "\"/>\n";
    }
    for (std::size_t i = 0; series.marks && i < shown.size(); ++i)
      out_ << "<circle class=\"m" << number << "\" cx=\"" << shown[i].first << "\" cy=\"" << shown[i].second
           << "\" r=\"3.5\"/>\n";
    const double x = kLeft + 4 + 165.0 * static_cast<double>(number);
    if (series.line) {
      line(("s" + std::to_string(number)).c_str(), x, kHeight - 10, x + 18, kHeight - 10);
    } else {
      out_ << "<circle class=\"m" << number << "\" cx=\"" << x + 9 << "\" cy=\"" << kHeight - 10
           << "\" r=\"3.5\"/>\n";
    }
    text("tick", x + 24, kHeight - 6, "start", series.name);
  }

  std::string end() {
    out_ << "</svg>\n";
    return out_.str();
  }

 private:
  [[nodiscard]] double at_x(double value) const { return kLeft + rule_x_(value) * (kWidth - kLeft - kRight); }
  [[nodiscard]] double at_y(double value) const {
    return kHeight - kBottom - rule_y_(value) * (kHeight - kTop - kBottom);
  }
  void line(const char* style, double x1, double y1, double x2, double y2) {
    out_ << "<line class=\"" << style << "\" x1=\"" << x1 << "\" y1=\"" << y1 << "\" x2=\"" << x2
         << "\" y2=\"" << y2 << "\"/>\n";
  }
  void text(const char* style, double x, double y, const char* anchor, const std::string& content) {
    out_ << "<text class=\"" << style << "\" x=\"" << x << "\" y=\"" << y << "\" text-anchor=\"" << anchor
         << "\">" << escaped(content) << "</text>\n";
  }

  Ruler rule_x_, rule_y_;
  std::ostringstream out_;
};

}  // namespace

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else if (c == '&') {
      result += "&amp;";
    } else if (c == '"') {
      result += "&quot;";
    } else {
      result += c;
    }
  }
  return result;
}

std::string svg_plot(const std::string& title, const Axis& x, const Axis& y,
                     const std::vector<Series>& series) {
  Drawing drawing(x, y, series);
  drawing.frame(title, x, y);
  for (std::size_t i = 0; i < series.size(); ++i) drawing.draw(series[i], i);
  return drawing.end();
}

}  // namespace marble::load
