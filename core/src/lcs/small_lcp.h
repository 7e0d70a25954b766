// Linear complementarity problems of few pairs: 0 ≤ z ⊥ M z + q ≥ 0, by Lemke's method (Cottle, Pang and
// Stone, "The Linear Complementarity Problem", 4.4). A perturbation of q keeps it from cycling: the
// lexicographic rule compares entries of the tableau that are zero but for rounding, and failed on contacts
// that are alike. The solution is that of the basis found, for q itself.
//
// global/lemke solves whole LCQPs: it chooses the unknowns among the variables of a scaled sparse problem,
// and allocates. Roll-outs solve thousands of dense LCPs a second, of a matrix that is given.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "model/linear_algebra.h"

namespace marble {

/// Keeps its memory from one problem to the next.
class SmallLcp {
 public:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using ConstMap = Eigen::Map<const RowMajor>;

  /// How a path ended.
  enum class End { solved, ray, pivot_limit, inexact, not_finite };

  /// Writes a solution to z, if there is one. M: m × m, q and z: m.
  [[nodiscard]] End solve(const ConstMap& M, const Eigen::Ref<const Vector>& q, Eigen::Ref<Vector> z);

 private:
  [[nodiscard]] End attempt(const ConstMap& M, const Eigen::Ref<const Vector>& q, int way,
                            Eigen::Ref<Vector> z);
  void reset(const ConstMap& M, const Eigen::Ref<const Vector>& q, int way);
  void exchange(Index row, Index column);
  [[nodiscard]] Index first_row() const;
  [[nodiscard]] Index blocking_row(Index column) const;
  [[nodiscard]] End follow();
  void refine(const ConstMap& M, const Eigen::Ref<const Vector>& q, Eigen::Ref<Vector> z) const;
  [[nodiscard]] bool is_exact(const ConstMap& M, const Eigen::Ref<const Vector>& q,
                              const Eigen::Ref<const Vector>& z) const;

  Index size_ = 0;
  RowMajor tableau_;                     // basic variables as functions of the nonbasic ones, θ and 1
  std::vector<Index> basic_, nonbasic_;  // w_i is i, z_i is m + i, θ is 2 m
  std::vector<Index> column_of_;         // of each w_i; −1 while it is basic
  Vector row_scale_, column_scale_;
  double size_of_q_ = 0.0;  // scaled
};

}  // namespace marble
