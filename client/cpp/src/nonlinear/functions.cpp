#include "nonlinear/functions.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "nonlinear/algebra.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Expected<std::vector<double>> of_size(const std::vector<double>& given, std::size_t size, double otherwise,
                                      const char* field) {
  if (given.empty()) return std::vector<double>(size, otherwise);
  if (given.size() == size) return given;
  return unexpected(invalid(field, std::to_string(given.size()),
                            "must have " + std::to_string(size) + " entries, as start has"));
}

Expected<std::vector<Index>> block_sizes(const std::vector<Index>& given, std::size_t size) {
  std::vector<Index> blocks = given;
  auto left = static_cast<std::int64_t>(size);
  if (blocks.empty()) {
    for (; left > 0; left -= blocks.back())
      blocks.push_back(static_cast<Index>(std::min<std::int64_t>(left, tuning::largest_block)));
    return blocks;
  }
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (blocks[i] < 1)
      return unexpected(
          invalid("blocks", static_cast<std::int64_t>(i), std::to_string(blocks[i]), "must be >= 1"));
    left -= blocks[i];
  }
  if (left != 0) return unexpected(invalid("blocks", "must add up to the size of start"));
  return blocks;
}

auto not_finite(std::span<const double> values) {
  return std::find_if(values.begin(), values.end(), [](double value) { return !std::isfinite(value); });
}

/// Copies the values of a function with `rows` rows.
Expected<void> keep(std::span<const double> given, std::size_t rows, const char* field, Point& point,
                    std::vector<double>& kept) {
  if (given.size() != rows)
    return unexpected(invalid(field, std::to_string(given.size()),
                              "must have " + std::to_string(rows) + " rows, as at the first point"));
  kept.assign(given.begin(), given.end());
  const auto bad = not_finite(given);
  if (bad != given.end() && !point.fault)
    point.fault = invalid(field, bad - given.begin(), std::to_string(*bad), "must be finite");
  return {};
}

Expected<void> check_pattern(const SparseMatrixView& given, std::size_t rows, std::size_t columns,
                             const std::string& field) {
  if (static_cast<std::size_t>(given.rows) != rows)
    return unexpected(invalid(field + ".rows", std::to_string(given.rows),
                              "must be " + std::to_string(rows) + ", a row a function"));
  if (static_cast<std::size_t>(given.columns) != columns)
    return unexpected(invalid(field + ".columns", std::to_string(given.columns),
                              "must be " + std::to_string(columns) + ", a column a variable"));
  const auto& pointers = given.column_pointers;
  if (pointers.size() != columns + 1 || pointers.front() != 0 ||
      static_cast<std::size_t>(pointers.back()) != given.row_indices.size() ||
      !std::is_sorted(pointers.begin(), pointers.end()))
    return unexpected(invalid(field + ".column_pointers",
                              "must ascend from 0 to the number of entries, one more than columns"));
  if (given.values.size() != given.row_indices.size())
    return unexpected(
        invalid(field + ".values", std::to_string(given.values.size()), "must be as many as row_indices"));
  for (std::size_t j = 0; j < columns; ++j) {
    for (Index k = pointers[j]; k < pointers[j + 1]; ++k) {
      const Index row = given.row_indices[k];
      if (row < 0 || static_cast<std::size_t>(row) >= rows ||
          (k > pointers[j] && row <= given.row_indices[k - 1]))
        return unexpected(invalid(field + ".row_indices", k, std::to_string(row),
                                  "must ascend within its column, in [0, " + std::to_string(rows) + ")"));
    }
  }
  return {};
}

/// Copies a matrix; the first call fixes the pattern, which no later one may leave. The fault is the first
/// entry that is not finite, if `fault` is given.
Expected<void> keep(const SparseMatrixView& given, std::size_t rows, std::size_t columns, const char* field,
                    SparseMatrix& kept, std::optional<Error>* fault) {
  if (kept.column_pointers.empty()) {
    kept.rows = static_cast<Index>(rows), kept.columns = static_cast<Index>(columns);
    kept.column_pointers.assign(columns + 1, 0);
    if (rows == 0 && given.rows == 0) return {};
    MARBLE_RETURN_IF_ERROR(check_pattern(given, rows, columns, field));
    kept.column_pointers.assign(given.column_pointers.begin(), given.column_pointers.end());
    kept.row_indices.assign(given.row_indices.begin(), given.row_indices.end());
  } else if (rows != 0 || given.rows != 0) {
    const auto stay = [&](std::span<const Index> now, const std::vector<Index>& first,
                          const char* part) -> Expected<void> {
      const auto [there, here] = std::mismatch(now.begin(), now.end(), first.begin(), first.end());
      if (there == now.end() && here == first.end()) return {};
      return unexpected(invalid(
          std::string(field) + part, there - now.begin(),
          there == now.end() ? "missing" : std::to_string(*there),
          here == first.end()
              ? "must not be there: patterns are fixed, as at the first point"
              : "must stay " + std::to_string(*here) + ": patterns are fixed, as at the first point"));
    };
    MARBLE_RETURN_IF_ERROR(stay(given.column_pointers, kept.column_pointers, ".column_pointers"));
    MARBLE_RETURN_IF_ERROR(stay(given.row_indices, kept.row_indices, ".row_indices"));
    if (given.values.size() != kept.row_indices.size())
      return unexpected(invalid(std::string(field) + ".values", std::to_string(given.values.size()),
                                "must be as many as row_indices"));
  }
  kept.values.assign(given.values.begin(), given.values.end());
  if (fault == nullptr || *fault) return {};
  const auto bad = not_finite(given.values);
  if (bad == given.values.end()) return {};
  const auto entry = bad - given.values.begin();
  const auto column = std::upper_bound(kept.column_pointers.begin(), kept.column_pointers.end(), entry) -
                      kept.column_pointers.begin() - 1;
  *fault = invalid(field, kept.row_indices[static_cast<std::size_t>(entry)], std::to_string(*bad),
                   "must be finite, in column " + std::to_string(column) + " too");
  return {};
}

}  // namespace

Expected<Functions> Functions::create(const Problem& problem) {
  Functions made;
  made.problem_ = &problem;
  const std::size_t n = problem.start.size();
  if (n == 0) return unexpected(invalid("start", "must have an entry for each variable"));
  if (!problem.values) return unexpected(invalid("values", "must be a function"));
  if (!problem.derivatives) return unexpected(invalid("derivatives", "must be a function"));
  MARBLE_RETURN_IF_ERROR(check_numbers(problem.start, n, "start"));
  MARBLE_ASSIGN_OR_RETURN(auto lower, of_size(problem.lower, n, -kInfinity, "lower"));
  MARBLE_ASSIGN_OR_RETURN(auto upper, of_size(problem.upper, n, kInfinity, "upper"));
  MARBLE_ASSIGN_OR_RETURN(auto scale, of_size(problem.scale, n, 1.0, "scale"));
  MARBLE_ASSIGN_OR_RETURN(auto blocks, block_sizes(problem.blocks, n));
  made.start_ = problem.start;
  for (std::size_t j = 0; j < n; ++j) {
    const auto index = static_cast<std::int64_t>(j);
    if (!(lower[j] <= upper[j]) || lower[j] >= infinite_limit || upper[j] <= -infinite_limit)
      return unexpected(
          invalid("lower", index, std::to_string(lower[j]), "must be <= upper, " + std::to_string(upper[j])));
    if (!(scale[j] > 0.0 && scale[j] < kInfinity))
      return unexpected(invalid("scale", index, std::to_string(scale[j]), "must be finite and > 0"));
    if (lower[j] <= -infinite_limit) lower[j] = -kInfinity;
    if (upper[j] >= infinite_limit) upper[j] = kInfinity;
    made.start_[j] = std::clamp(made.start_[j], lower[j], upper[j]);
  }
  made.lower_ = std::move(lower), made.upper_ = std::move(upper), made.scale_ = std::move(scale);
  made.blocks_ = std::move(blocks);
  return made;
}

bool leave_bounds(std::span<double> x, std::span<const double> lower, std::span<const double> upper,
                  std::span<const double> scale) {
  bool left = false;
  for (std::size_t j = 0; j < x.size(); ++j) {
    const double off = tuning::off_bound * std::min(scale.empty() ? 1.0 : scale[j], upper[j] - lower[j]);
    if (!(off > 0.0) || (x[j] != lower[j] && x[j] != upper[j])) continue;
    x[j] += x[j] == lower[j] ? off : -off;
    left = true;
  }
  return left;
}

bool Functions::leave_bounds(std::vector<double>& x) const {
  return nonlinear::leave_bounds(x, lower_, upper_, scale_);
}

Expected<void> Functions::values(Point& point) {
  const Values given = problem_->values(point.x);
  ++evaluations_;
  point.fault.reset();
  if (given.G.size() != given.H.size())
    return unexpected(invalid("values.H", std::to_string(given.H.size()),
                              "must have as many rows as G, " + std::to_string(given.G.size())));
  if (!std::isfinite(given.objective))
    point.fault = invalid("values.objective", std::to_string(given.objective), "must be finite");
  const std::span<const double> parts[] = {given.equalities, given.inequalities, given.G, given.H,
                                           given.residuals};
  std::vector<double>* kept[] = {&point.equalities, &point.inequalities, &point.G, &point.H,
                                 &point.residuals};
  constexpr const char* kFields[] = {"values.equalities", "values.inequalities", "values.G", "values.H",
                                     "values.residuals"};
  if (!rows_) {
    rows_.emplace();
    for (std::size_t i = 0; i < rows_->size(); ++i) (*rows_)[i] = parts[i].size();
  }
  for (std::size_t i = 0; i < rows_->size(); ++i) {
    MARBLE_RETURN_IF_ERROR(keep(parts[i], (*rows_)[i], kFields[i], point, *kept[i]));
  }
  point.objective = given.objective + 0.5 * dot(point.residuals, point.residuals);
  return {};
}

Expected<void> Functions::derivatives(const Point& point, Linearisation& linearisation) {
  const Derivatives given = problem_->derivatives(point.x);
  ++linearisations_;
  const std::size_t n = variables();
  if (given.gradient.size() != n)
    return unexpected(invalid("derivatives.gradient", std::to_string(given.gradient.size()),
                              "must have " + std::to_string(n) + " entries"));
  const auto bad = not_finite(given.gradient);  // not check_numbers, which makes a string of the field
  linearisation.fault.reset();
  if (bad != given.gradient.end())
    linearisation.fault =
        invalid("derivatives.gradient", bad - given.gradient.begin(), std::to_string(*bad), "must be finite");
  linearisation.gradient.assign(given.gradient.begin(), given.gradient.end());
  Linearisation& at = linearisation;
  for (const auto& [part, rows, kept, field] :
       {std::tuple{&given.equalities, point.equalities.size(), &at.equalities, "derivatives.equalities"},
        std::tuple{&given.inequalities, point.inequalities.size(), &at.inequalities,
                   "derivatives.inequalities"},
        std::tuple{&given.G, point.G.size(), &at.G, "derivatives.G"},
        std::tuple{&given.H, point.H.size(), &at.H, "derivatives.H"},
        std::tuple{&given.residuals, point.residuals.size(), &at.residuals, "derivatives.residuals"}}) {
    MARBLE_RETURN_IF_ERROR(keep(*part, rows, n, field, *kept, &at.fault));
  }
  add_transposed(at.residuals, point.residuals, 1.0, at.gradient);
  return {};
}

Expected<void> Functions::hessian(const Point& point, const Multipliers& multipliers, SparseMatrix& upper) {
  const SparseMatrixView given = problem_->hessian(point.x, multipliers);
  const std::size_t n = variables();
  MARBLE_RETURN_IF_ERROR(keep(given, n, n, "hessian", upper, nullptr));
  for (std::size_t j = 0; j < n; ++j) {
    const Index end = upper.column_pointers[j + 1];
    if (end > upper.column_pointers[j] && static_cast<std::size_t>(upper.row_indices[end - 1]) > j)
      return unexpected(invalid("hessian.row_indices", end - 1, std::to_string(upper.row_indices[end - 1]),
                                "must be <= its column: the upper triangle alone"));
  }
  return {};
}

}  // namespace marble::nonlinear

// Compares the caller's derivatives with differences of the functions.
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
  MARBLE_ASSIGN_OR_RETURN(auto functions, Functions::create(problem));
  const std::size_t n = functions.variables();
  MARBLE_RETURN_IF_ERROR(check_numbers(x, n, "x"));
  Point here;
  here.x.assign(x.begin(), x.end());
  Point above = here, below = here;
  Linearisation at;
  MARBLE_RETURN_IF_ERROR(functions.values(here));
  MARBLE_RETURN_IF_ERROR(functions.derivatives(here, at));
  if (at.fault) return unexpected(*at.fault);
  for (std::size_t j = 0; j < n; ++j) {
    const double h = tuning::difference * std::max(1.0, std::abs(x[j]));
    above.x[j] = x[j] + h, below.x[j] = x[j] - h;
    for (Point* point : {&above, &below}) MARBLE_RETURN_IF_ERROR(functions.values(*point));
    above.x[j] = below.x[j] = x[j];
    for (const Point* point : {&here, &above, &below})
      if (point->fault) return unexpected(*point->fault);
    const auto agree = [&](const std::vector<double>& up, const std::vector<double>& down,
                           const SparseMatrix& jacobian, const char* field) -> Expected<void> {
      for (std::size_t i = 0; i < up.size(); ++i) {
        const double given = entry(jacobian, static_cast<Index>(i), static_cast<Index>(j));
        MARBLE_RETURN_IF_ERROR(compare(given, (up[i] - down[i]) / (2.0 * h), tolerance, field, i, j));
      }
      return {};
    };
    const double slope = (above.objective - below.objective) / (2.0 * h);
    MARBLE_RETURN_IF_ERROR(compare(at.gradient[j], slope, tolerance, "derivatives.gradient", j, j));
    for (const auto& [up, down, jacobian, field] :
         {std::tuple{&above.equalities, &below.equalities, &at.equalities, "derivatives.equalities"},
          std::tuple{&above.inequalities, &below.inequalities, &at.inequalities, "derivatives.inequalities"},
          std::tuple{&above.G, &below.G, &at.G, "derivatives.G"},
          std::tuple{&above.H, &below.H, &at.H, "derivatives.H"},
          std::tuple{&above.residuals, &below.residuals, &at.residuals, "derivatives.residuals"}}) {
      MARBLE_RETURN_IF_ERROR(agree(*up, *down, *jacobian, field));
    }
  }
  return {};
}

}  // namespace marble::nonlinear
