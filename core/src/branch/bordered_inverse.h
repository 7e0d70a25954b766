// Inverse of a small matrix whose rows and columns come and go one by one, updated at each in O(n²).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "model/rows.h"

namespace marble {

class BorderedInverse {
 public:
  /// For at most this many rows.
  explicit BorderedInverse(Index capacity);

  [[nodiscard]] Index size() const { return size_; }
  void clear() { size_ = 0; }
  /// Adds the last row and column: entry(a, b) is that of the matrix, for a or b = size().
  template <class Entry>
  void append(const Entry& entry) {
    const Index n = size_;
    for (Index a = 0; a <= n; ++a) matrix_(a, n) = entry(a, n);
    for (Index b = 0; b < n; ++b) matrix_(n, b) = entry(n, b);
    append();
  }
  /// Removes row and column k; the last ones take their place.
  void remove(Index k);
  /// Replaces the right-hand side by the solution, refined once. Returns false if there is none, also to
  /// rounding.
  [[nodiscard]] bool solve(Eigen::Ref<Eigen::VectorXd> x);

 private:
  void append();

  Index size_ = 0;
  bool valid_ = true;  // of the inverse; if not, each solve() factorizes the matrix
  Eigen::MatrixXd matrix_, inverse_;
  Eigen::VectorXd column_, row_, right_side_, residual_;
  std::vector<int> pivots_;
};

}  // namespace marble
