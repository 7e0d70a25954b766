// Provides the matrix B of the subproblem's ½ dᵀBd: its upper triangle, in a fixed pattern that includes the
// diagonal.
#pragma once

#include <algorithm>
#include <vector>

#include "nonlinear/functions.h"

namespace marble::nonlinear {

/// Returns what `automatic` means for the problem, of which `point` is a point; any other kind is returned
/// unchanged.
[[nodiscard]] Curvature chosen(Curvature kind, const Problem& problem, const Point& point);

class Model {
 public:
  /// Creates B of a kind other than automatic. `first` are the derivatives at `point`.
  [[nodiscard]] static Expected<Model> create(Curvature kind, Functions& functions, const Point& point,
                                              const Linearisation& first, const Multipliers& multipliers);

  /// Computes B at a new point. `step` and `change` are those of x and of the Lagrangian's gradient since the
  /// last.
  [[nodiscard]] Expected<void> move(Functions& functions, const Point& point, const Linearisation& at,
                                    const Multipliers& multipliers, std::span<const double> step,
                                    std::span<const double> change);
  /// Adds σ / scale² to the diagonal, in place of the earlier shift.
  void shift(double sigma);
  [[nodiscard]] double shift() const { return sigma_; }
  /// True if B depends on past steps: bfgs after its first one.
  [[nodiscard]] bool learns() const { return std::find(known_.begin(), known_.end(), true) != known_.end(); }
  /// Returns how many Hessians had entries that were not finite and were replaced.
  [[nodiscard]] std::int32_t replaced() const { return replaced_; }

  [[nodiscard]] const SparseMatrix& upper() const { return upper_; }

 private:
  Model() = default;
  void take_hessian(std::span<const double> step, std::span<const double> change);
  void take_gauss_newton(const SparseMatrix& jacobian);
  void update_block(Index first, Index size, std::span<const double> step, std::span<const double> change);
  [[nodiscard]] double& entry(Index row, Index column) {  // of a block that is full above its diagonal
    return upper_.values[upper_.column_pointers[column + 1] - 1 - (column - row)];
  }

  Curvature kind_ = Curvature::none;
  SparseMatrix upper_;
  SparseMatrix hessian_;          // exact: the caller's matrix
  std::vector<Index> positions_;  // exact: of its entries in B
  std::vector<double> inverse_scale_squared_;
  std::vector<Index> blocks_;
  std::vector<bool> known_;      // bfgs: whether a block has seen a step
  std::vector<double> product_;  // bfgs: B s
  double sigma_ = 0.0;
  std::int32_t replaced_ = 0;
};

}  // namespace marble::nonlinear
