#include "global/dual_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "global/row_activity.h"
#include "model/tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

double reach_from(const ScaledProblem& p, ConstVectorRef z) {
  return tuning::tree_radius * (1.0 + max_abs(z.cwiseProduct(p.variable_scale)));
}

Box::Box(const ScaledProblem& p, double far, int passes) {
  lower.setConstant(p.variables(), -kInfinity);
  upper.setConstant(p.variables(), kInfinity);
  for (int pass = 0; pass < passes; ++pass) {
    tighten(p.A, p.b, true);
    tighten(p.rows, p.offset, false);
  }
  radius = far / p.variable_scale.array();
}

// A row Σ a z + o ≥ 0 bounds each term from below by the maximum of the others; a row = 0 also from above.
// The bounds are widened by the rounding of their sums.
void Box::tighten(const RowMatrix& matrix, const Vector& offset, bool equality) {
  for (Index row = 0; row < matrix.rows; ++row) {
    RowActivity least, most;
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      const double value = matrix.values[k];
      if (value == 0.0) continue;
      const Index j = matrix.column_indices[k];
      least.add(value * (value > 0.0 ? lower[j] : upper[j]));
      most.add(value * (value > 0.0 ? upper[j] : lower[j]));
    }
    if (most.infinite > 1 && (!equality || least.infinite > 1)) continue;
    const double terms = static_cast<double>(matrix.row_size(row)) + 2.0;
    const double error = terms * tuning::bound_roundoff * (std::abs(offset[row]) + least.size + most.size);
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      const double value = matrix.values[k];
      if (value == 0.0) continue;
      const Index j = matrix.column_indices[k];
      const auto bound = [&](double term, bool at_least) {  // a z ≥ term, or ≤
        if (!std::isfinite(term)) return;
        const double at = term / value;
        const double wider = tuning::bound_roundoff * std::abs(at);
        if ((value > 0.0) == at_least) {
          lower[j] = std::max(lower[j], at - wider);
        } else {
          upper[j] = std::min(upper[j], at + wider);
        }
      };
      const double old_lower = lower[j], old_upper = upper[j];
      bound(-offset[row] - most.without(value * (value > 0.0 ? old_upper : old_lower)) - error, true);
      if (equality)
        bound(-offset[row] - least.without(value * (value > 0.0 ? old_lower : old_upper)) + error, false);
    }
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

// Returns the value, minus what r costs at the worst point of the box.
double DualBound::settle(const Box& box, double relative) {
  paid_ = value_.error(tuning::bound_roundoff);
  double negligible = 0.0;
  for (const CarefulSum& entry : residual_) negligible = std::max(negligible, entry.error(relative));
  for (Index j = 0; j < problem_.variables(); ++j) {
    const CarefulSum& entry = residual_[static_cast<std::size_t>(j)];
    const double error = entry.error(tuning::bound_roundoff);
    const bool small = std::abs(entry.value()) <= negligible;
    const auto least = [&](double coefficient) {
      const double at = coefficient > 0.0 ? box.lower[j] : box.upper[j];
      if (std::isfinite(at)) return coefficient * at;
      return small ? -std::abs(coefficient) * box.radius[j] : -kInfinity;
    };
    paid_ -= std::min(least(entry.value() - error), least(entry.value() + error));
  }
  // The sum above has its own rounding error.
  const double bound =
      value_.value() - paid_ - tuning::bound_roundoff * (1.0 + problem_.variables()) * std::abs(paid_);
  return std::isfinite(bound) ? bound : -kInfinity;
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
  return settle(box, tuning::exactness);
}

bool DualBound::contradicts(const Box& box, ConstVectorRef y, ConstVectorRef mu) {
  std::fill(residual_.begin(), residual_.end(), CarefulSum());
  value_ = {};
  add_rows(y, mu);
  return settle(box, tuning::roundoff) > 0.0;
}

}  // namespace marble
