#include "output/convergence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

namespace marble::cli {
namespace {

constexpr std::string_view kLogarithmic[] = {"equality_violation",
                                             "inequality_violation",
                                             "complementarity_violation",
                                             "kkt_residual",
                                             "kappa",
                                             "rho",
                                             "regularization",
                                             "gap"};
constexpr std::array kStylesOfCurves = {Style::series_1, Style::series_2, Style::series_3, Style::series_4,
                                        Style::series_5};

}  // namespace

double largest(const Violations& violations) {
  double worst = violations.equality;
  for (const double other : {violations.inequality, violations.complementarity}) {
    if (std::isnan(other) || other > worst) worst = other;
  }
  return worst;
}

bool repeats_factorization(const Progress& before, const Progress& row) {
  const bool path = row.kappa > 0.0 && before.kappa > 0.0;
  return path && row.factorizations - before.factorizations > row.iteration - before.iteration;
}

std::vector<Curve> convergence_summary(std::span<const Progress> rows) {
  Curve violation{"largest violation", 'v', Style::series_1, {}, true};
  Curve residual{"KKT residual", 'r', Style::series_2, {}, false};
  Curve kappa{"kappa", 'k', Style::series_3, {}, false};
  for (const Progress& row : rows) {
    violation.values.push_back(largest(row.violations));
    residual.values.push_back(row.kkt_residual);
    kappa.values.push_back(row.kappa);
  }
  return {kappa, residual, violation};  // the last one is drawn on top
}

std::vector<Curve> proof_summary(std::span<const Progress> rows) {
  Curve incumbent{"incumbent", 'i', Style::series_1, {}, false};
  Curve bound{"bound", 'b', Style::series_2, {}, false};
  for (const Progress& row : rows) {
    incumbent.values.push_back(row.incumbent);
    bound.values.push_back(row.bound);
  }
  return {bound, incumbent};
}

bool has_tree(std::span<const Progress> rows) {
  return std::any_of(rows.begin(), rows.end(), [](const Progress& row) { return row.nodes > 0; });
}

bool is_logarithmic(const ProgressColumn& column) {
  return std::find(std::begin(kLogarithmic), std::end(kLogarithmic), column.name) != std::end(kLogarithmic);
}

bool zero_counts(const ProgressColumn& column) {
  return column.name.ends_with("_violation") || column.name == "gap";
}

Curve curve_of(std::span<const Progress> rows, const ProgressColumn& column, int number) {
  const auto style = kStylesOfCurves[static_cast<std::size_t>(number) % kStylesOfCurves.size()];
  const std::string_view name = column.name.substr(0, column.name.rfind("_violation"));
  Curve curve{std::string(name), static_cast<char>('a' + number % 26), style, {}, zero_counts(column)};
  for (const Progress& row : rows) curve.values.push_back(column.get(row));
  return curve;
}

namespace {

constexpr double kMostDecades = 24.0;  // below that is rounding

bool is_logarithmic_one(const ProgressColumn* column) { return is_logarithmic(*column); }

// The position of exact zeros on a log axis: below every other value.
struct Floor {
  double at = 0.0;
  bool used = false;
};

Floor floor_of(std::span<const Progress> rows, std::span<const ProgressColumn* const> columns) {
  double low = std::numeric_limits<double>::infinity(), high = 0.0;
  Floor floor;
  for (const ProgressColumn* column : columns) {
    if (!is_logarithmic(*column)) continue;
    for (const Progress& row : rows) {
      const double value = column->get(row);
      if (value == 0.0 && zero_counts(*column)) floor.used = true;
      if (!std::isfinite(value) || value <= 0.0) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  if (high == 0.0) low = high = 1.0;
  low = std::max(low, high * std::pow(10.0, -kMostDecades));
  floor.at = std::pow(10.0, std::floor(std::log10(low)) - 1.0);
  return floor;
}

std::string value_text(const Progress& row, const ProgressColumn& column, const Floor& floor) {
  const double value = column.get(row);
  if (!is_logarithmic(column) || value > floor.at) return gnuplot_number(value);
  if (value > 0.0) return gnuplot_number(floor.at);
  return value == 0.0 && zero_counts(column) ? gnuplot_number(floor.at) : "NaN";
}

// Column 1 is x, column 2 is 1 where factorizations were repeated, then the drawn columns.
std::string data_block(std::span<const Progress> rows, const ProgressColumn& x,
                       std::span<const ProgressColumn* const> columns, const Floor& floor) {
  std::string text = "$trace << END_OF_TRACE\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    text += gnuplot_number(x.get(rows[i]));
    text += i > 0 && repeats_factorization(rows[i - 1], rows[i]) ? " 1" : " NaN";
    for (const ProgressColumn* column : columns) text += " " + value_text(rows[i], *column, floor);
    text += '\n';
  }
  return text + "END_OF_TRACE\n";
}

std::string panel(std::span<const ProgressColumn* const> columns, bool logarithmic, bool marks) {
  std::string curves;
  if (marks) {
    curves =
        "$trace using 1:2 axes x1y2 with impulses linewidth 1 linecolor rgb '#c8ccd0' "
        "title 'repeated factorization'";
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (is_logarithmic(*columns[i]) != logarithmic) continue;
    if (!curves.empty()) curves += ", \\\n  ";
    curves += "$trace using 1:" + std::to_string(i + 3) + " with linespoints pointtype 7 pointsize 0.35 " +
              "linewidth 1.6 linecolor " + gnuplot_colour(i) + " title '" + std::string(columns[i]->name) +
              "'";
  }
  return "plot " + curves + "\n";
}

// Marks decades, at most 12 of them, and 0 if it is drawn.
std::string log_axis(const Floor& floor) {
  std::string text =
      "set logscale y 10\nset format y '10^{%T}'\nset yrange [" + gnuplot_number(floor.at) + ":*]\n";
  if (floor.used) text += "set ytics add ('0' " + gnuplot_number(floor.at) + ")\n";
  return text;
}

}  // namespace

std::string trace_picture(std::span<const Progress> rows, const ProgressColumn& x,
                          std::span<const ProgressColumn* const> columns, PictureFormat format,
                          const std::string& title) {
  const Floor floor = floor_of(rows, columns);
  const bool upper = std::any_of(columns.begin(), columns.end(), is_logarithmic_one);
  const bool lower = !std::all_of(columns.begin(), columns.end(), is_logarithmic_one);
  bool repeated = false;
  for (std::size_t i = 1; i < rows.size(); ++i) repeated |= repeats_factorization(rows[i - 1], rows[i]);
  std::string text = data_block(rows, x, columns, floor);
  text += gnuplot_style(format) + "set y2range [0:1]\nset lmargin 12\n";
  text += "set title '" + gnuplot_text(title) + "' noenhanced\n";
  if (upper && lower) text += "set multiplot\nset size 1,0.64\nset origin 0,0.36\n";
  const std::string x_label = "set xlabel '" + std::string(x.name) + "' noenhanced\n";
  if (upper) text += log_axis(floor) + (lower ? "" : x_label) + panel(columns, true, repeated);
  if (upper && lower) text += "unset title\nset size 1,0.36\nset origin 0,0\n";
  if (lower) {
    text += "unset logscale y\nset format y '%g'\nset yrange [*:*]\nset ytics autofreq\n" + x_label;
    text += panel(columns, false, repeated && !upper);
  }
  return text + (upper && lower ? "unset multiplot\n" : "");
}

}  // namespace marble::cli
