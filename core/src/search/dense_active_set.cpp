#include "search/dense_active_set.h"

#include <Eigen/Cholesky>
#include <Eigen/Jacobi>
#include <algorithm>
#include <cmath>
#include <limits>

#include "model/tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

DenseActiveSet::DenseActiveSet(const ScaledProblem& problem)
    : problem_(problem),
      rows_(problem),
      upper_(problem.variables(), problem.variables()),
      image_(problem.variables()) {}

bool DenseActiveSet::factor(double delta) {
  const Index n = problem_.variables();
  const SymmetricMatrix& Q = problem_.Q;
  delta_ = delta;
  Eigen::MatrixXd hessian = delta * Eigen::MatrixXd::Identity(n, n);
  for (Index column = 0; column < n; ++column)
    for (Index k = Q.column_pointers[column]; k < Q.column_pointers[column + 1]; ++k)
      hessian(column, Q.row_indices[k]) += Q.values[k];  // the lower triangle
  const double largest = n > 0 ? hessian.diagonal().maxCoeff() : 1.0;
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> factor(hessian);
  if (factor.info() != Eigen::Success) return false;
  const double least = n > 0 ? factor.matrixLLT().diagonal().minCoeff() : 1.0;
  if (!(least * least > tuning::exactness * largest)) return false;
  inverse_ = factor.matrixU().solve(Eigen::MatrixXd::Identity(n, n));
  return true;
}

DenseActiveSet::End DenseActiveSet::solve(const std::vector<Kind>& kinds, ConstVectorRef center,
                                          const Interrupt& interrupt) {
  kinds_ = kinds;
  held_.clear(), multiplier_.clear(), sign_.clear();
  satisfied_.assign(static_cast<std::size_t>(rows_.size()), 0);
  basis_ = inverse_;
  image_ = basis_.transpose() * (delta_ * center - problem_.g);
  z_ = basis_ * image_;
  steps_left_ = tuning::tree_steps;
  while (true) {
    if (interrupt.requested()) return End::stopped;
    const Index row = most_violated();
    if (row < 0) return End::optimal;
    if (const End end = take(row); end != End::optimal) return end;
  }
}

Vector DenseActiveSet::multipliers() const {
  Vector result(static_cast<Eigen::Index>(held_.size()));
  for (std::size_t i = 0; i < held_.size(); ++i)
    result[static_cast<Eigen::Index>(i)] = -sign_[i] * multiplier_[i];
  return result;
}

// Returns equalities first. A violation no larger than the rounding of the row's terms counts as satisfied.
Index DenseActiveSet::most_violated() const {
  Index result = -1;
  double worst = 0.0;
  for (Index row = 0; row < rows_.size(); ++row) {
    const Kind kind = kinds_[static_cast<std::size_t>(row)];
    if (kind == Kind::ignored || satisfied_[static_cast<std::size_t>(row)] != 0) continue;
    const auto [value, size] = rows_.value(row, z_);
    if (kind == Kind::equality) return row;  // held even if it is satisfied
    const double violation = -value - tuning::roundoff * (1.0 + size);
    if (violation <= worst) continue;
    worst = violation;
    result = row;
  }
  return result;
}

// Computes how z and the held multipliers change with the multiplier of a row.
void DenseActiveSet::find_direction(const Vector& normal) {
  const auto held = static_cast<Eigen::Index>(held_.size());
  image_ = basis_.transpose() * normal;
  const auto free = image_.tail(image_.size() - held);
  dependent_ = free.norm() <= tuning::rounding * image_.norm();
  direction_ = basis_.rightCols(image_.size() - held) * free;
  rates_ = image_.head(held);
  upper_.topLeftCorner(held, held).triangularView<Eigen::Upper>().solveInPlace(rates_);
}

// Raises the violated row's multiplier until the row is satisfied. Rows whose multiplier reaches zero leave.
DenseActiveSet::End DenseActiveSet::take(Index row) {
  const bool equality = kinds_[static_cast<std::size_t>(row)] == Kind::equality;
  Vector normal(problem_.variables());
  rows_.copy(row, normal);
  RowAccess::Value at = rows_.value(row, z_);
  const double sign = equality && at.value > 0.0 ? -1.0 : 1.0;
  normal *= sign;
  double multiplier = 0.0;
  while (steps_left_-- > 0) {
    find_direction(normal);
    double to_drop = kInfinity;
    Eigen::Index drops = -1;
    for (Eigen::Index i = 0; i < rates_.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (kinds_[static_cast<std::size_t>(held_[k])] == Kind::equality || !(rates_[i] > 0.0)) continue;
      const double ratio = multiplier_[k] / rates_[i];
      if (ratio >= to_drop) continue;
      to_drop = ratio;
      drops = i;
    }
    const double slope = direction_.dot(normal);
    const bool blocked = dependent_ || !(slope > 0.0);
    const double to_hold = blocked ? kInfinity : std::max(0.0, -sign * at.value / slope);
    if (blocked && (drops < 0 || std::abs(at.value) <= tuning::exactness * (1.0 + at.size))) {
      if (!(std::abs(at.value) <= tuning::exactness * (1.0 + at.size))) return End::infeasible;
      satisfied_[static_cast<std::size_t>(row)] = 1;  // a copy of held rows, within the tolerance
      return End::optimal;
    }
    const double step = std::min(to_drop, to_hold);
    if (!blocked) z_ += step * direction_;
    for (Eigen::Index i = 0; i < rates_.size(); ++i)
      multiplier_[static_cast<std::size_t>(i)] -= step * rates_[i];
    multiplier += step;
    if (!(max_abs(z_) < kInfinity) || !(multiplier < kInfinity)) return End::infeasible;
    if (to_hold <= to_drop) {
      append(row, multiplier, sign);
      return End::optimal;
    }
    drop(drops);
    at = rows_.value(row, z_);
  }
  return End::stopped;
}

// Rotates the free columns of the basis so that the first of them contains the whole row.
void DenseActiveSet::append(Index row, double multiplier, double sign) {
  const auto held = static_cast<Eigen::Index>(held_.size());
  for (Eigen::Index i = image_.size() - 1; i > held; --i) {
    Eigen::JacobiRotation<double> turn;
    turn.makeGivens(image_[i - 1], image_[i], &image_[i - 1]);
    basis_.applyOnTheRight(i - 1, i, turn);
  }
  upper_.col(held).head(held + 1) = image_.head(held + 1);
  held_.push_back(row);
  multiplier_.push_back(multiplier);
  sign_.push_back(sign);
  satisfied_[static_cast<std::size_t>(row)] = 1;
}

void DenseActiveSet::drop(Eigen::Index at) {
  const auto held = static_cast<Eigen::Index>(held_.size());
  satisfied_[static_cast<std::size_t>(held_[static_cast<std::size_t>(at)])] = 0;
  for (Eigen::Index column = at + 1; column < held; ++column)
    upper_.col(column - 1).head(column + 1) = upper_.col(column).head(column + 1);
  for (Eigen::Index i = at; i + 1 < held; ++i) {
    Eigen::JacobiRotation<double> turn;
    turn.makeGivens(upper_(i, i), upper_(i + 1, i), &upper_(i, i));
    const Eigen::Index others = held - 2 - i;
    if (others > 0) upper_.block(0, i + 1, held, others).applyOnTheLeft(i, i + 1, turn.adjoint());
    basis_.applyOnTheRight(i, i + 1, turn);
  }
  held_.erase(held_.begin() + at);
  multiplier_.erase(multiplier_.begin() + at);
  sign_.erase(sign_.begin() + at);
}

}  // namespace marble
