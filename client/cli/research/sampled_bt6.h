// Provides BT6 (P. Boggs, J. Tolle) with the noise of "Retrospective Approximation for Stochastic Constrained
// Problems Using Sequential Quadratic Programming": F = f + ξ‖x − x₀ − 1‖², ξ ~ U[−1, 1].
#pragma once

#include "marble/composite/counter_random.h"
#include "marble/retrospective.h"

namespace marble::cli {

/// Five variables, two equalities. As Eξ = 0, the optimum is that of f, 0.277044924.
class SampledBt6 {
 public:
  explicit SampledBt6(std::uint64_t seed) : random_(seed) {}
  SampledBt6(const SampledBt6&) = delete;
  SampledBt6& operator=(const SampledBt6&) = delete;

  /// The result borrows this object.
  [[nodiscard]] nonlinear::SampledProblem sampled();
  /// Returns ‖(∇f + ∇cᵀy, c)‖₂ without the noise, with the y that minimizes it.
  [[nodiscard]] double true_kkt(std::span<const double> x);

 private:
  void evaluate_rows(std::span<const double> x);
  void differentiate(std::span<const double> x);

  CounterRandom random_;
  std::int64_t samples_ = 0;
  double sum_ = 0.0, mean_ = 0.0;  // of ξ over the samples
  double rows_[2] = {}, gradient_[5] = {};
  SparseMatrix jacobian_{2, 5, {0, 1, 2, 3, 4, 5}, {0, 1, 1, 0, 0}, std::vector<double>(5, 0.0)};
};

}  // namespace marble::cli
