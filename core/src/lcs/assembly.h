// The LCQP of a planning problem: its pattern once, and its numbers in place.
#pragma once

#include "lcs/task.h"

namespace marble {

/// Variables are (u_0, λ_0, x_1, …, u_{N−1}, λ_{N−1}, x_N); equalities, inequalities and pairs are ordered by
/// stage too. Columns of a block have their entries one after the other, so that a block is written without a
/// table of places.
class LcsAssembly {
 public:
  explicit LcsAssembly(const CheckedTask& task);

  /// Writes A and R.
  void set_matrices(const LCS& lcs);
  /// Writes b and r, which depend on the initial state.
  void set_state(const LCS& lcs, std::span<const double> x0);
  /// Writes g and c0, which depend on the targets, the initial state and the input before stage 0.
  void set_costs(const CheckedTask& task, std::span<const double> x0, std::span<const double> last_u);
  /// Writes d: the limits, and in the first stage the input of which the input's change begins.
  void set_limits(const CheckedTask& task, std::span<const double> last_u);

  /// Returns the problem.
  [[nodiscard]] const OwnedProblem& problem() const { return problem_; }

  /// Copies a point z to a trajectory of the right sizes, whose first state stays.
  void split(std::span<const double> z, LcsTrajectory& trajectory) const;
  /// The reverse.
  void join(const LcsTrajectory& trajectory, std::span<double> z) const;

 private:
  void make_hessian(const CheckedTask& task);
  void make_dynamics();
  void make_bounds(const CheckedTask& task);
  void make_pairs();

  Index states_, inputs_, pairs_, stages_, width_;  // width_: variables of a stage
  OwnedProblem problem_;
};

}  // namespace marble
