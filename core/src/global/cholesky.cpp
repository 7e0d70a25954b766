#include "global/cholesky.h"

#include <algorithm>
#include <cmath>

namespace marble {

void Cholesky::reserve(Eigen::Index size) {
  if (size <= factor_.rows()) return;
  Eigen::MatrixXd larger(std::max<Eigen::Index>(2 * factor_.rows(), size),
                         std::max<Eigen::Index>(2 * factor_.rows(), size));
  larger.topLeftCorner(size_, size_) = factor_.topLeftCorner(size_, size_);
  factor_.swap(larger);
}

bool Cholesky::factorize(const Eigen::MatrixXd& matrix) {
  reserve(matrix.rows());
  auto block = factor_.topLeftCorner(matrix.rows(), matrix.rows());
  block.triangularView<Eigen::Lower>() = matrix;
  Eigen::Ref<Eigen::MatrixXd> in_place(block);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(in_place);
  size_ = llt.info() == Eigen::Success ? matrix.rows() : 0;
  return llt.info() == Eigen::Success;
}

void Cholesky::solve_lower(VectorRef x) const {  // NOLINT: solved in place
  factor_.topLeftCorner(size_, size_).triangularView<Eigen::Lower>().solveInPlace(x);
}

void Cholesky::solve_upper(VectorRef x) const {  // NOLINT: solved in place
  factor_.topLeftCorner(size_, size_).triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

void Cholesky::append(ConstVectorRef row, double pivot) {
  reserve(size_ + 1);
  factor_.row(size_).head(size_) = row.transpose();
  factor_(size_, size_) = pivot;
  ++size_;
}

// The rows after it move up, which leaves one entry above the diagonal in each; a rotation of two columns
// removes it.
void Cholesky::remove(Eigen::Index i) {
  const Eigen::Index last = size_ - 1;
  for (Eigen::Index column = 0; column < size_; ++column) {
    double* const entries = factor_.col(column).data();
    const Eigen::Index from = std::max(i, column > 0 ? column - 1 : 0);  // the first one that moves up
    std::copy(entries + from + 1, entries + size_, entries + from);
  }
  for (Eigen::Index column = i; column < last; ++column) {
    double* const left = factor_.col(column).data();
    double* const right = factor_.col(column + 1).data();
    const double length = std::hypot(left[column], right[column]);
    const double c = left[column] / length;
    const double s = right[column] / length;
    for (Eigen::Index row = column; row < last; ++row) {
      const double old = left[row];
      left[row] = c * old + s * right[row];
      right[row] = c * right[row] - s * old;
    }
  }
  size_ = last;
}

void Cholesky::take(const Cholesky& other) {
  if (factor_.rows() < other.size_) factor_.resize(other.size_ + 16, other.size_ + 16);
  size_ = other.size_;
  factor_.topLeftCorner(size_, size_).triangularView<Eigen::Lower>() =
      other.factor_.topLeftCorner(size_, size_);
}

}  // namespace marble
