#include "tree/dual_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tuning.h"

namespace marble {
namespace {

// Widened by the rounding of its quotient.
double outward(double value, double direction) {
  return value + direction * tuning::bound_roundoff * std::abs(value);
}

}  // namespace

Box::Box(const ScaledProblem& p, double radius) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  lower.setConstant(p.variables(), -kInfinity);
  upper.setConstant(p.variables(), kInfinity);
  const auto tighten = [this](const RowMatrix& matrix, const Vector& offset, bool equality) {
    for (Index row = 0; row < matrix.rows; ++row) {
      if (matrix.row_size(row) != 1) continue;
      const Index k = matrix.row_pointers[row];
      const double value = matrix.values[k];
      if (value == 0.0) continue;
      const Index j = matrix.column_indices[k];
      const double at = -offset[row] / value;
      if (!std::isfinite(at)) continue;
      if (equality || value > 0.0) lower[j] = std::max(lower[j], outward(at, -1.0));
      if (equality || value < 0.0) upper[j] = std::min(upper[j], outward(at, 1.0));
    }
  };
  tighten(p.A, p.b, true);
  tighten(p.rows, p.offset, false);
  bounded = lower.allFinite() && upper.allFinite();
  for (Index j = 0; j < p.variables(); ++j) {
    const double far = radius / p.variable_scale[j];
    if (!std::isfinite(lower[j])) lower[j] = -far;
    if (!std::isfinite(upper[j])) upper[j] = far;
  }
}

DualBound::DualBound(const ScaledProblem& problem)
    : problem_(problem), residual_(static_cast<std::size_t>(problem.variables())) {}

void DualBound::add_rows(ConstVectorRef y, ConstVectorRef mu) {
  const auto add = [this](const RowMatrix& matrix, const Vector& offset, ConstVectorRef multipliers,
                          double sign) {
    for (Index row = 0; row < matrix.rows; ++row) {
      const double multiplier = sign * multipliers[row];
      if (multiplier == 0.0) continue;
      value_.add(offset[row], multiplier);
      for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k)
        residual_[static_cast<std::size_t>(matrix.column_indices[k])].add(matrix.values[k], multiplier);
    }
  };
  add(problem_.A, problem_.b, y, 1.0);
  add(problem_.rows, problem_.offset, mu, -1.0);
}

// The value with what r costs at the worst point of the box.
double DualBound::settle(const Box& box) {
  paid_ = value_.error(tuning::bound_roundoff);
  for (Index j = 0; j < problem_.variables(); ++j) {
    const CarefulSum& entry = residual_[static_cast<std::size_t>(j)];
    const double error = entry.error(tuning::bound_roundoff);
    const double low = entry.value() - error;
    const double high = entry.value() + error;
    paid_ -= std::min(std::min(low * box.lower[j], high * box.lower[j]),
                      std::min(low * box.upper[j], high * box.upper[j]));
  }
  // The sum above has its own rounding.
  const double bound =
      value_.value() - paid_ - tuning::bound_roundoff * (1.0 + problem_.variables()) * std::abs(paid_);
  return std::isfinite(bound) ? bound : -std::numeric_limits<double>::infinity();
}

double DualBound::of_objective(const Box& box, ConstVectorRef z, ConstVectorRef y, ConstVectorRef mu) {
  std::fill(residual_.begin(), residual_.end(), CarefulSum());
  value_ = {};
  for (Index j = 0; j < problem_.variables(); ++j)
    residual_[static_cast<std::size_t>(j)].add(problem_.g[j], 1.0);
  const SymmetricMatrix& Q = problem_.Q;
  for (Index column = 0; column < Q.size; ++column) {
    for (Index k = Q.column_pointers[column]; k < Q.column_pointers[column + 1]; ++k) {
      const Index row = Q.row_indices[k];
      const double value = Q.values[k];
      residual_[static_cast<std::size_t>(row)].add(value, z[column]);
      if (row != column) residual_[static_cast<std::size_t>(column)].add(value, z[row]);
      value_.add((row == column ? -0.5 : -1.0) * value * z[row], z[column]);
    }
  }
  add_rows(y, mu);
  return settle(box);
}

bool DualBound::contradicts(const Box& box, ConstVectorRef y, ConstVectorRef mu) {
  std::fill(residual_.begin(), residual_.end(), CarefulSum());
  value_ = {};
  add_rows(y, mu);
  return settle(box) > 0.0;
}

}  // namespace marble
