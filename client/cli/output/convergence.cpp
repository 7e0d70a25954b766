#include "output/convergence.h"

#include <algorithm>
#include <array>
#include <cmath>
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

}  // namespace marble::cli
