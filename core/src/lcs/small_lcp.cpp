#include "lcs/small_lcp.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "model/tuning.h"
#include "path/noise.h"

namespace marble {
namespace {

double scale_for(double largest) { return largest > 0.0 ? 1.0 / largest : 1.0; }

}  // namespace

// w = M z + q + θ with rows, then columns, scaled to a largest entry of 1, and q perturbed at random.
void SmallLcp::reset(const ConstMap& M, const Eigen::Ref<const Vector>& q, int way) {
  const Index m = size_;
  if (tableau_.rows() != m) {
    tableau_.resize(m, m + 2);
    row_scale_.resize(m), column_scale_.resize(m);
    basic_.resize(static_cast<std::size_t>(m)), column_of_.resize(static_cast<std::size_t>(m));
    nonbasic_.resize(static_cast<std::size_t>(m) + 1);
  }
  for (Index i = 0; i < m; ++i) {
    row_scale_[i] = scale_for(M.row(i).cwiseAbs().maxCoeff());
    tableau_.row(i).head(m) = row_scale_[i] * M.row(i);
    tableau_(i, m) = 1.0;
    tableau_(i, m + 1) = row_scale_[i] * q[i];
    basic_[static_cast<std::size_t>(i)] = i;
    nonbasic_[static_cast<std::size_t>(i)] = m + i;
    column_of_[static_cast<std::size_t>(i)] = -1;
  }
  size_of_q_ = tableau_.col(m + 1).cwiseAbs().maxCoeff();
  for (Index i = 0; i < m; ++i) {
    tableau_(i, m + 1) += tuning::exactness * size_of_q_ *
                          (1.0 + noise(static_cast<std::uint64_t>(way), static_cast<std::uint64_t>(i)));
  }
  column_scale_ = tableau_.leftCols(m).cwiseAbs().colwise().maxCoeff();
  for (Index j = 0; j < m; ++j) {
    column_scale_[j] = scale_for(column_scale_[j]);
    tableau_.col(j) *= column_scale_[j];
  }
  nonbasic_[static_cast<std::size_t>(m)] = 2 * m;
}

// Exchanges a basic variable and a nonbasic one (pivot).
void SmallLcp::exchange(Index row, Index column) {
  const double pivot = tableau_(row, column);
  tableau_.row(row) /= -pivot;
  tableau_(row, column) = 1.0 / pivot;
  for (Index i = 0; i < size_; ++i) {
    const double factor = tableau_(i, column);
    if (i == row || factor == 0.0) continue;
    tableau_(i, column) = 0.0;
    tableau_.row(i) += factor * tableau_.row(row);
  }
  Index& leaving = basic_[static_cast<std::size_t>(row)];
  Index& entering = nonbasic_[static_cast<std::size_t>(column)];
  std::swap(leaving, entering);
  if (entering < size_) column_of_[static_cast<std::size_t>(entering)] = column;
  if (leaving < size_) column_of_[static_cast<std::size_t>(leaving)] = -1;
}

// The row whose w is negative the most: θ takes its place. −1 if there is none.
Index SmallLcp::first_row() const {
  const Index constant = size_ + 1;
  Index first = -1;
  for (Index i = 0; i < size_; ++i) {
    if (tableau_(i, constant) < 0.0 && (first < 0 || tableau_(i, constant) < tableau_(first, constant)))
      first = i;
  }
  return first;
}

// The first row that reaches zero as a nonbasic variable grows; θ comes before others. −1 if there is none.
Index SmallLcp::blocking_row(Index column) const {
  const Index constant = size_ + 1;
  const double least = tuning::zero * tableau_.col(column).cwiseAbs().maxCoeff();
  double shortest = std::numeric_limits<double>::infinity();
  Index first = -1;
  for (Index row = 0; row < size_; ++row) {
    const double rate = -tableau_(row, column);
    if (!(rate > least)) continue;
    const double length = std::max(tableau_(row, constant), 0.0) / rate;
    const bool theta = basic_[static_cast<std::size_t>(row)] == 2 * size_;
    if (theta ? length <= shortest * (1.0 + tuning::exactness) : length < shortest)
      first = row, shortest = length;
  }
  return first;
}

SmallLcp::End SmallLcp::follow() {
  const Index theta = 2 * size_;
  Index row = first_row();
  if (row < 0) return End::solved;  // q ≥ 0 up to rounding
  Index column = size_;
  const Index limit = tuning::lemke_pivots * size_;
  for (Index pivot = 0; row >= 0 && pivot < limit; ++pivot) {
    const Index leaving = basic_[static_cast<std::size_t>(row)];
    exchange(row, column);
    if (!std::isfinite(tableau_(row, size_ + 1))) return End::not_finite;
    if (leaving == theta) return End::solved;
    const Index entering = leaving < size_ ? leaving + size_ : leaving - size_;
    column = static_cast<Index>(std::ranges::find(nonbasic_, entering) - nonbasic_.begin());
    row = blocking_row(column);
  }
  return row < 0 ? End::ray : End::pivot_limit;
}

// Removes what rounding has left of the w that are zero: z depends on them as the tableau says.
void SmallLcp::refine(const ConstMap& M, const Eigen::Ref<const Vector>& q, Eigen::Ref<Vector> z) const {
  for (Index j = 0; j < size_; ++j) {
    const Index column = column_of_[static_cast<std::size_t>(j)];
    if (column < 0) continue;
    const double w = row_scale_[j] * (M.row(j).dot(z) + q[j]);
    if (w == 0.0) continue;
    for (Index row = 0; row < size_; ++row) {
      const Index unknown = basic_[static_cast<std::size_t>(row)] - size_;
      if (unknown >= 0 && unknown < size_) z[unknown] -= column_scale_[unknown] * tableau_(row, column) * w;
    }
  }
}

// Whether min(w, z), scaled, is zero up to rounding.
bool SmallLcp::is_exact(const ConstMap& M, const Eigen::Ref<const Vector>& q,
                        const Eigen::Ref<const Vector>& z) const {
  const double size = std::max(size_of_q_, z.cwiseQuotient(column_scale_).maxCoeff());
  for (Index i = 0; i < size_; ++i) {
    const double w = row_scale_[i] * (M.row(i).dot(z) + q[i]);
    if (!(std::abs(std::min(w, z[i] / column_scale_[i])) <= tuning::zero * size)) return false;
  }
  return true;
}

SmallLcp::End SmallLcp::attempt(const ConstMap& M, const Eigen::Ref<const Vector>& q, int way,
                                Eigen::Ref<Vector> z) {
  reset(M, q, way);
  if (const End end = follow(); end != End::solved) return end;
  z.setZero();
  for (Index row = 0; row < size_; ++row) {
    const Index unknown = basic_[static_cast<std::size_t>(row)] - size_;
    if (unknown >= 0 && unknown < size_) z[unknown] = column_scale_[unknown] * tableau_(row, size_ + 1);
  }
  refine(M, q, z);
  z = z.cwiseMax(0.0);
  if (!z.allFinite()) return End::not_finite;
  return is_exact(M, q, z) ? End::solved : End::inexact;
}

SmallLcp::End SmallLcp::solve(const ConstMap& M, const Eigen::Ref<const Vector>& q, Eigen::Ref<Vector> z) {
  size_ = static_cast<Index>(q.size());
  z.setZero();
  if (!q.allFinite()) return End::not_finite;
  if (size_ == 0 || q.minCoeff() >= 0.0) return End::solved;
  End first = End::solved;
  for (int way = 0; way < tuning::lemke_ways; ++way) {
    const End end = attempt(M, q, way, z);
    if (end == End::solved) return end;
    if (way == 0) first = end;
  }
  return first;
}

}  // namespace marble
