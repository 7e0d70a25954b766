#include "research/measures.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace marble::cli {
namespace {

// M z + offset
std::vector<double> rows_at(const SparseMatrix& m, const std::vector<double>& offset,
                            std::span<const double> z) {
  std::vector<double> rows = offset;
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      rows[m.row_indices[k]] += m.values[k] * z[j];
  }
  return rows;
}

// zᵀQz, with Q given in full or by its upper triangle.
double quadratic(const OwnedProblem& p, std::span<const double> z) {
  const bool half = p.hessian_form == HessianForm::upper_triangle;
  double sum = 0.0;
  for (Index j = 0; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      const Index i = p.Q.row_indices[k];
      sum += (half && i != j ? 2.0 : 1.0) * p.Q.values[k] * z[i] * z[j];
    }
  }
  return sum;
}

}  // namespace

bool Measures::feasible(double tolerance, PairMeasure pairs) const {
  const bool by_product = pairs == PairMeasure::product && !std::isnan(product);
  return std::max({equality, inequality, by_product ? product : smaller_side}) <= tolerance;
}

Measures measure(const OwnedProblem& p, std::span<const double> z) {
  Measures m;
  m.objective = 0.5 * quadratic(p, z) + p.c0;
  for (std::size_t j = 0; j < p.g.size(); ++j) m.objective += p.g[j] * z[j];
  for (const double row : rows_at(p.A, p.b, z)) m.equality = std::max(m.equality, std::abs(row));
  for (const double row : rows_at(p.C, p.d, z)) m.inequality = std::max(m.inequality, -row);
  const std::vector<double> s = rows_at(p.L, p.l, z), t = rows_at(p.R, p.r, z);
  for (std::size_t i = 0; i < s.size(); ++i) {
    m.inequality = std::max({m.inequality, -s[i], -t[i]});
    m.smaller_side = std::max(m.smaller_side, std::abs(std::min(s[i], t[i])));
    m.product = std::max(m.product, std::abs(s[i] * t[i]));
  }
  return m;
}

}  // namespace marble::cli
