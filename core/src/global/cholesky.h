// The factorization L Lᵀ of a symmetric positive definite matrix whose rows are added and removed one at a
// time.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "model/linear_algebra.h"

namespace marble {

class Cholesky {
 public:
  [[nodiscard]] Eigen::Index size() const { return size_; }
  void clear() { size_ = 0; }

  /// Factorizes a whole matrix, given by its lower triangle. Returns false, and is empty, if it is not
  /// positive definite.
  [[nodiscard]] bool factorize(const Eigen::MatrixXd& matrix);
  /// x ← L⁻¹x, x ← L⁻ᵀx.
  void solve_lower(VectorRef x) const;
  void solve_upper(VectorRef x) const;
  /// Adds a row at the end: L⁻¹ of its entries, and the square root of what remains of its diagonal.
  void append(ConstVectorRef row, double pivot);
  /// Removes row i.
  void remove(Eigen::Index i);

  /// Copies another factor, without its spare capacity.
  void take(const Cholesky& other);

 private:
  void reserve(Eigen::Index size);

  Eigen::MatrixXd factor_;  // lower triangle; larger than necessary
  Eigen::Index size_ = 0;
};

}  // namespace marble
