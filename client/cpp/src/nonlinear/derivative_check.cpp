// Compares the caller's derivatives with differences of the functions.
#include <algorithm>
#include <cmath>
#include <string>

#include "nonlinear/functions.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {
namespace {

double entry(const SparseMatrix& matrix, Index row, Index column) {
  for (Index k = matrix.column_pointers[column]; k < matrix.column_pointers[column + 1]; ++k)
    if (matrix.row_indices[k] == row) return matrix.values[k];
  return 0.0;
}

Expected<void> compare(double given, double difference, double tolerance, const char* field, std::size_t row,
                       std::size_t column) {
  if (std::abs(given - difference) <= tolerance * std::max(1.0, std::abs(given))) return {};
  return unexpected(invalid(
      field, static_cast<std::int64_t>(row), std::to_string(given),
      "must be " + std::to_string(difference) + " in column " + std::to_string(column) + ", by differences"));
}

}  // namespace

Expected<void> check_derivatives(const Problem& problem, std::span<const double> x, double tolerance) {
  auto functions = Functions::create(problem);
  if (!functions) return unexpected(functions.error());
  const std::size_t n = functions->variables();
  if (auto finite = check_numbers(x, n, "x"); !finite) return finite;
  Point here;
  here.x.assign(x.begin(), x.end());
  Point above = here, below = here;
  Linearisation at;
  if (auto given = functions->values(here); !given) return given;
  if (auto given = functions->derivatives(here, at); !given) return given;
  if (at.fault) return unexpected(*at.fault);
  for (std::size_t j = 0; j < n; ++j) {
    const double h = tuning::difference * std::max(1.0, std::abs(x[j]));
    above.x[j] = x[j] + h, below.x[j] = x[j] - h;
    for (Point* point : {&above, &below})
      if (auto given = functions->values(*point); !given) return given;
    above.x[j] = below.x[j] = x[j];
    for (const Point* point : {&here, &above, &below})
      if (point->fault) return unexpected(*point->fault);
    const auto agree = [&](const std::vector<double>& up, const std::vector<double>& down,
                           const SparseMatrix& jacobian, const char* field) -> Expected<void> {
      for (std::size_t i = 0; i < up.size(); ++i) {
        const double given = entry(jacobian, static_cast<Index>(i), static_cast<Index>(j));
        if (auto same = compare(given, (up[i] - down[i]) / (2.0 * h), tolerance, field, i, j); !same)
          return same;
      }
      return {};
    };
    const double slope = (above.objective - below.objective) / (2.0 * h);
    if (auto same = compare(at.gradient[j], slope, tolerance, "derivatives.gradient", j, j); !same)
      return same;
    for (const auto& [up, down, jacobian, field] :
         {std::tuple{&above.equalities, &below.equalities, &at.equalities, "derivatives.equalities"},
          std::tuple{&above.inequalities, &below.inequalities, &at.inequalities, "derivatives.inequalities"},
          std::tuple{&above.G, &below.G, &at.G, "derivatives.G"},
          std::tuple{&above.H, &below.H, &at.H, "derivatives.H"},
          std::tuple{&above.residuals, &below.residuals, &at.residuals, "derivatives.residuals"}}) {
      if (auto same = agree(*up, *down, *jacobian, field); !same) return same;
    }
  }
  return {};
}

}  // namespace marble::nonlinear
