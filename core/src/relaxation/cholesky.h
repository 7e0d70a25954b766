// L Lᵀ of a symmetric positive definite matrix that rows enter and leave one at a time.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "data/linear_algebra.h"

namespace marble {

class Cholesky {
 public:
  [[nodiscard]] Eigen::Index size() const { return size_; }
  void clear() { size_ = 0; }

  /// Of a whole matrix, its lower triangle. False, and empty, if it is not positive definite.
  [[nodiscard]] bool factorize(const Eigen::MatrixXd& matrix);
  /// x ← L⁻¹x, x ← L⁻ᵀx.
  void solve_lower(VectorRef x) const;
  void solve_upper(VectorRef x) const;
  /// A row at the end: L⁻¹ of its entries, and the root of what is left of its diagonal.
  void append(ConstVectorRef row, double pivot);
  /// Takes row i out.
  void remove(Eigen::Index i);

  /// Copies another one's, without the room it has beyond.
  void take(const Cholesky& other);

 private:
  void reserve(Eigen::Index size);

  Eigen::MatrixXd factor_;  // lower triangle; larger than it need be
  Eigen::Index size_ = 0;
};

}  // namespace marble
