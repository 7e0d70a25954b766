#include "output/trace_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "output/convergence.h"

namespace marble::cli {
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
