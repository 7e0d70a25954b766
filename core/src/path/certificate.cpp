#include "path/certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/careful_sum.h"
#include "model/tuning.h"

namespace marble {
namespace {

double smallest(ConstVectorRef values) { return values.size() == 0 ? 0.0 : values.minCoeff(); }

// Visits the product of d with each row from `first` to before `end`, and the rounding error that a largest
// entry of d (1) may hide.
template <class Visit>
bool all_rows(const RowMatrix& matrix, Index first, Index end, ConstVectorRef d, Visit&& visit) {
  for (Index row = first; row < end; ++row) {
    CarefulSum sum;
    double size = 0.0;
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      sum.add(matrix.values[k], d[matrix.column_indices[k]]);
      size += std::abs(matrix.values[k]);
    }
    if (!visit(row, sum.value(), tuning::roundoff * size)) return false;
  }
  return true;
}

// Returns −1 if dᵀQd is negative by more than rounding, 0 if Qd is 0 to rounding, else 1. Requires |d|∞ = 1.
int curvature(const SymmetricMatrix& Q, ConstVectorRef d) {
  std::vector<CarefulSum> image(static_cast<std::size_t>(Q.size));
  Vector size = Vector::Zero(Q.size);
  CarefulSum whole;
  for (Index column = 0; column < Q.size; ++column) {
    for (Index k = Q.column_pointers[column]; k < Q.column_pointers[column + 1]; ++k) {
      const Index row = Q.row_indices[k];
      const double value = Q.values[k];
      image[static_cast<std::size_t>(row)].add(value, d[column]);
      size[row] += std::abs(value);
      whole.add((row == column ? 1.0 : 2.0) * value * d[row], d[column]);
      if (row == column) continue;
      image[static_cast<std::size_t>(column)].add(value, d[row]);
      size[column] += std::abs(value);
    }
  }
  if (whole.value() < -tuning::roundoff * size.sum()) return -1;
  for (Index i = 0; i < Q.size; ++i) {
    if (!(std::abs(image[static_cast<std::size_t>(i)].value()) <= tuning::roundoff * size[i])) return 1;
  }
  return 0;
}

// The multipliers in the order of a certificate, normalized to size 1.
struct Multipliers {
  Multipliers(const Iterate& x, double size) : y(x.y() / size), rows(-x.lambda() / size) {}
  Vector y;
  Vector rows;  // ν, ξ and η
};

double size_of(const Iterate& x) { return std::max(max_abs(x.y()), max_abs(x.lambda())); }

}  // namespace

std::optional<FarkasProof> infeasibility_certificate(const ScaledProblem& p, const Iterate& x,
                                                     std::span<const std::uint8_t> zero) {
  const double size = size_of(x);
  if (!(size > 0.0) || !std::isfinite(size)) return std::nullopt;
  const Multipliers m(x, size);
  for (Index row = 0; row < p.layout.size(); ++row) {
    if (m.rows[row] < 0.0 && (zero.empty() || zero[static_cast<std::size_t>(row)] == 0)) return std::nullopt;
  }
  const auto n = static_cast<std::size_t>(p.variables());
  std::vector<CarefulSum> combination(n);
  Vector hidden = Vector::Zero(p.variables());
  CarefulSum gap;
  const auto combine = [&](const RowMatrix& matrix, const Vector& offset, const Vector& multipliers,
                           double sign) {
    for (Index row = 0; row < matrix.rows; ++row) {
      gap.add(sign * offset[row], multipliers[row]);
      for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
        combination[static_cast<std::size_t>(matrix.column_indices[k])].add(sign * matrix.values[k],
                                                                            multipliers[row]);
        hidden[matrix.column_indices[k]] += tuning::roundoff * std::abs(matrix.values[k]);
      }
    }
  };
  combine(p.A, p.b, m.y, 1.0);
  combine(p.rows, p.offset, m.rows, -1.0);
  const double least_gap = gap.value() - gap.error();
  if (!(least_gap > 0.0) || !std::isfinite(least_gap)) return std::nullopt;
  double residual = 0.0;
  for (std::size_t j = 0; j < n; ++j) {
    const auto column = static_cast<Index>(j);
    const double entry = std::abs(combination[j].value());
    if (!(entry <= hidden[column])) return std::nullopt;
    residual += (entry + combination[j].error()) / p.variable_scale[column];
  }
  FarkasProof proof;
  proof.radius = least_gap / residual;
  const double point = max_abs(x.z().cwiseProduct(p.variable_scale));
  if (!(proof.radius >= tuning::proof_farther * point)) return std::nullopt;
  proof.multipliers.reserve(static_cast<std::size_t>(m.y.size() + m.rows.size()));
  bool lost = false;  // to underflow
  const auto append = [&](const Vector& multipliers, const Vector& row_scale) {
    for (Eigen::Index i = 0; i < multipliers.size(); ++i) {
      const double value = multipliers[i] * row_scale[i] / gap.value() + 0.0;  // avoids −0
      lost = lost || !std::isfinite(value) ||
             (multipliers[i] != 0.0 && std::abs(value) < std::numeric_limits<double>::min());
      proof.multipliers.push_back(value);
    }
  };
  append(m.y, p.equality_scale);
  append(m.rows, p.row_scale);
  if (lost) return std::nullopt;
  return proof;
}

std::optional<std::vector<double>> unbounded_direction(const ScaledProblem& p, ConstVectorRef direction) {
  const double size = max_abs(direction);
  if (!(size > 0.0) || !std::isfinite(size)) return std::nullopt;
  const Vector d = direction / size;
  const int curved = curvature(p.Q, d);
  if (curved > 0) return std::nullopt;
  if (curved == 0) {
    const double largest = max_abs(p.g);  // so that no product overflows
    if (!(largest > 0.0) || !std::isfinite(largest)) return std::nullopt;
    CarefulSum slope;
    for (Eigen::Index j = 0; j < d.size(); ++j) slope.add(p.g[j] / largest, d[j]);
    if (!(slope.value() < -tuning::roundoff * p.g.lpNorm<1>() / largest)) return std::nullopt;
  }
  const RowLayout& rows = p.layout;
  std::vector<std::uint8_t> s_stays(static_cast<std::size_t>(rows.pairs));
  const auto stays = [](Index, double value, double rounding) { return std::abs(value) <= rounding; };
  const auto grows = [](Index, double value, double rounding) { return value >= -rounding; };
  const auto note = [&](Index row, double value, double rounding) {
    s_stays[static_cast<std::size_t>(row - rows.s(0))] = std::abs(value) <= rounding;
    return value >= -rounding;
  };
  const auto one_stays = [&](Index row, double value, double rounding) {
    return value >= -rounding &&
           (s_stays[static_cast<std::size_t>(row - rows.t(0))] != 0 || std::abs(value) <= rounding);
  };
  if (!all_rows(p.A, 0, p.equalities(), d, stays) || !all_rows(p.rows, 0, rows.inequalities, d, grows) ||
      !all_rows(p.rows, rows.s(0), rows.t(0), d, note) ||
      !all_rows(p.rows, rows.t(0), rows.size(), d, one_stays))
    return std::nullopt;
  Vector unscaled = d.cwiseProduct(p.variable_scale);
  unscaled /= max_abs(unscaled);
  return std::vector<double>(unscaled.data(), unscaled.data() + unscaled.size());
}

bool seems_infeasible(const ScaledProblem& p, const Iterate& x) {
  const double size = size_of(x);
  if (!(size > 0.0) || !std::isfinite(size)) return false;
  Multipliers m(x, size);
  if (smallest(m.rows.tail(2 * p.pairs())) < -tuning::near) return false;
  m.rows = m.rows.cwiseMax(0.0);
  const double gap = p.b.dot(m.y) - p.offset.dot(m.rows);
  if (!(gap > 0.0)) return false;
  Vector combination = Vector::Zero(p.variables());
  add_transposed(p.A, m.y, combination);
  add_transposed(p.rows, -m.rows, combination);
  return max_abs(combination) <= tuning::near * gap;
}

bool ContradictionScreen::suggests_infeasible(const ScaledProblem& p, const Iterate& x) {
  const double size = size_of(x);
  if (!(size > 0.0) || !std::isfinite(size)) return false;
  y_ = x.y() / size;
  rows_ = (x.lambda() / size).cwiseMin(0.0);  // −ν, −ξ, −η, without wrong signs
  const double gap = p.b.dot(y_) + p.offset.dot(rows_);
  if (!(gap > 0.0)) return false;
  left_.setZero();
  add_transposed(p.A, y_, left_);
  add_transposed(p.rows, rows_, left_);
  return tuning::suspicion_farther * std::max(1.0, max_abs(x.z())) * left_.lpNorm<1>() <= gap;
}

bool seems_unbounded(const ScaledProblem& p, const Iterate& x) {
  const double size = max_abs(x.z());
  if (!(size > 0.0) || !std::isfinite(size)) return false;
  const Vector d = x.z() / size;
  Vector image(p.variables());
  multiply(p.Q, d, image);
  if (!(d.dot(image) < -tuning::near) && !(max_abs(image) <= tuning::near && p.g.dot(d) < -tuning::near))
    return false;
  image.resize(p.equalities());
  multiply(p.A, d, image);
  if (max_abs(image) > tuning::near) return false;
  RowVector rates(p.layout);
  multiply(p.rows, d, rates.all);
  return smallest(rates.inequality()) >= -tuning::near &&
         max_abs(rates.s().cwiseMin(rates.t())) <= tuning::near;
}

}  // namespace marble
