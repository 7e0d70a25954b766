#include "nonlinear/embedding.h"

#include <algorithm>
#include <limits>
#include <string>

namespace marble::nonlinear {

Embedding::Embedding(const Problem& problem, const Measured& measured)
    : given_(problem), measured_(measured), embedded_(problem), row_of_(problem.start.size(), -1) {
  if (measured_.variables.empty() || !given_.values || !given_.derivatives || !check()) return;
  for (std::size_t k = 0; k < measured_.variables.size(); ++k) {
    const auto j = static_cast<std::size_t>(measured_.variables[k]);
    row_of_[j] = static_cast<Index>(k);
    if (j < embedded_.lower.size()) embedded_.lower[j] = -std::numeric_limits<double>::infinity();
    if (j < embedded_.upper.size()) embedded_.upper[j] = std::numeric_limits<double>::infinity();
  }
  embedded_.values = [this](std::span<const double> x) { return values(x); };
  embedded_.derivatives = [this](std::span<const double> x) { return derivatives(x); };
  if (!given_.hessian) return;
  embedded_.hessian = [this](std::span<const double> x, const Multipliers& multipliers) {
    multipliers_ = multipliers;
    multipliers_.equalities.resize(multipliers.equalities.size() - measured_.variables.size());
    return given_.hessian(x, multipliers_);
  };
}

Expected<void> Embedding::check() const {
  const auto n = static_cast<Index>(given_.start.size());
  for (std::size_t k = 0; k < measured_.variables.size(); ++k) {
    const std::string field = "measured.variables";
    const auto here = measured_.variables.begin() + static_cast<std::ptrdiff_t>(k);
    if (*here < 0 || *here >= n)
      return unexpected(invalid(field, static_cast<std::int64_t>(k), std::to_string(*here),
                                "must be in [0, " + std::to_string(n) + "), a variable"));
    if (std::find(measured_.variables.begin(), here, *here) != here)
      return unexpected(
          invalid(field, static_cast<std::int64_t>(k), std::to_string(*here), "must not be named twice"));
  }
  return {};
}

Expected<void> Embedding::check_rows(const Point& point) const {
  const auto rows = static_cast<Index>(point.equalities.size() - measured_.variables.size());
  for (std::size_t k = 0; k < measured_.equalities.size(); ++k) {
    const Index row = measured_.equalities[k];
    if (row < 0 || row >= rows)
      return unexpected(invalid("measured.equalities", static_cast<std::int64_t>(k), std::to_string(row),
                                "must be in [0, " + std::to_string(rows) + "), a row of c_E"));
  }
  return {};
}

std::size_t Embedding::row(std::size_t k, const Point& point) const {
  const std::size_t variables = measured_.variables.size();
  if (k < variables) return point.equalities.size() - variables + k;
  return static_cast<std::size_t>(measured_.equalities[k - variables]);
}

Values Embedding::values(std::span<const double> x) {
  Values values = given_.values(x);
  equalities_.assign(values.equalities.begin(), values.equalities.end());
  for (const Index j : measured_.variables) equalities_.push_back(x[static_cast<std::size_t>(j)]);
  values.equalities = equalities_;
  return values;
}

// An invalid matrix is passed on unchanged: a later check reports its name.
Derivatives Embedding::derivatives(std::span<const double> x) {
  Derivatives derivatives = given_.derivatives(x);
  const SparseMatrixView& own = derivatives.equalities;
  const auto& pointers = own.column_pointers;
  const bool none = own.rows == 0;
  const bool fits = pointers.size() == x.size() + 1 && pointers.front() == 0 &&
                    std::is_sorted(pointers.begin(), pointers.end()) &&
                    static_cast<std::size_t>(pointers.back()) == own.row_indices.size() &&
                    own.values.size() == own.row_indices.size();
  if (!none && !fits) return derivatives;
  SparseMatrix& made = jacobian_;
  made.rows = own.rows + static_cast<Index>(measured_.variables.size());
  made.columns = static_cast<Index>(x.size());
  made.column_pointers.assign(1, 0), made.row_indices.clear(), made.values.clear();
  for (std::size_t j = 0; j < x.size(); ++j) {
    for (Index k = none ? 0 : pointers[j]; k < (none ? 0 : pointers[j + 1]); ++k)
      made.row_indices.push_back(own.row_indices[k]), made.values.push_back(own.values[k]);
    if (row_of_[j] >= 0) made.row_indices.push_back(own.rows + row_of_[j]), made.values.push_back(1.0);
    made.column_pointers.push_back(static_cast<Index>(made.row_indices.size()));
  }
  derivatives.equalities = made.view();
  return derivatives;
}

}  // namespace marble::nonlinear
