#include "branch/bordered_inverse.h"

#include <cmath>

#include "model/tuning.h"

extern "C" void dgesv_(const int* n, const int* nrhs, double* a, const int* lda, int* pivots, double* b,
                       const int* ldb, int* info);

namespace marble {

BorderedInverse::BorderedInverse(Index capacity)
    : matrix_(capacity, capacity),
      inverse_(capacity, capacity),
      column_(capacity),
      row_(capacity),
      right_side_(capacity),
      residual_(capacity),
      pivots_(static_cast<std::size_t>(capacity)) {}

void BorderedInverse::append() {
  const Index n = size_++;
  if (n == 0) valid_ = true;
  if (!valid_) return;
  auto column = column_.head(n), row = row_.head(n);
  auto inverse = inverse_.topLeftCorner(n, n);
  column.noalias() = inverse * matrix_.col(n).head(n);
  row.noalias() = inverse.transpose() * matrix_.row(n).head(n).transpose();
  const double diagonal = matrix_(n, n);
  const double pivot = diagonal - matrix_.row(n).head(n).dot(column);
  valid_ = std::abs(pivot) > tuning::exactness * std::abs(diagonal);
  if (!valid_) return;
  inverse_.col(n).head(n) = -column / pivot;
  inverse_.row(n).head(n) = -row.transpose() / pivot;
  inverse_(n, n) = 1.0 / pivot;
  for (Index b = 0; b < n; ++b) inverse.col(b) += (row[b] / pivot) * column;
}

void BorderedInverse::remove(Index k) {
  const Index last = --size_;
  const double pivot = inverse_(k, k);
  valid_ = valid_ && std::isfinite(1.0 / pivot);
  if (valid_) {
    column_.head(last + 1) = inverse_.col(k).head(last + 1);
    row_.head(last + 1) = inverse_.row(k).head(last + 1);
    for (Index b = 0; b <= last; ++b)
      inverse_.col(b).head(last + 1) -= (row_[b] / pivot) * column_.head(last + 1);
  }
  for (Eigen::MatrixXd* m : {&matrix_, &inverse_}) {
    m->col(k).head(last + 1) = m->col(last).head(last + 1);
    m->row(k).head(last) = m->row(last).head(last);
  }
}

bool BorderedInverse::solve(Eigen::Ref<Eigen::VectorXd> x) {
  if (size_ == 0) return true;
  const auto matrix = matrix_.topLeftCorner(size_, size_);
  const auto inverse = inverse_.topLeftCorner(size_, size_);
  auto right_side = right_side_.head(size_), residual = residual_.head(size_), sizes = row_.head(size_);
  right_side = x;
  if (valid_) {
    x.noalias() = inverse * right_side;
    residual = right_side;
    residual.noalias() -= matrix * x;
    x.noalias() += inverse * residual;
    residual = right_side;
    sizes = right_side.cwiseAbs();
    for (Index b = 0; b < size_; ++b) {
      residual -= x[b] * matrix.col(b);
      sizes += std::abs(x[b]) * matrix.col(b).cwiseAbs();
    }
    valid_ = (residual.array().abs() <= tuning::rounding * sizes.array()).all();
    if (valid_) return true;
  }
  inverse_.topLeftCorner(size_, size_) = matrix;
  x = right_side;
  const int n = size_, one = 1, stride = static_cast<int>(inverse_.rows());
  int info = 0;
  dgesv_(&n, &one, inverse_.data(), &stride, pivots_.data(), x.data(), &n, &info);
  return info == 0;
}

}  // namespace marble
