#include "relaxation/dual_bound.h"

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

Box::Box(const ScaledProblem& p, double far) {
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
  radius = far / p.variable_scale.array();
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
  double negligible = 0.0;
  for (const CarefulSum& entry : residual_) negligible = std::max(negligible, entry.error(tuning::exactness));
  for (Index j = 0; j < problem_.variables(); ++j) {
    const CarefulSum& entry = residual_[static_cast<std::size_t>(j)];
    const double error = entry.error(tuning::bound_roundoff);
    const bool small = std::abs(entry.value()) <= negligible;
    const auto least = [&](double coefficient) {
      const double at = coefficient > 0.0 ? box.lower[j] : box.upper[j];
      if (std::isfinite(at)) return coefficient * at;
      return small ? -std::abs(coefficient) * box.radius[j] : -std::numeric_limits<double>::infinity();
    };
    paid_ -= std::min(least(entry.value() - error), least(entry.value() + error));
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
