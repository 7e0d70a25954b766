// The problem without complementarity, in which every side of a pair is only ≥ 0, for varying linear costs.
// The methods that put the pairs into the objective solve it repeatedly.
#pragma once

#include "branch/branch_engines.h"

namespace marble {

class RelaxedQp {
 public:
  RelaxedQp(const ScaledProblem& problem, Kkt& kkt);

  /// Loads the current numbers of the problem; the next solve starts at z.
  void start(ConstVectorRef z);
  /// Solves exactly with the linear cost g + Jᵀ·costs, J all rows, starting with the rows that the last
  /// solution held. Returns false if Q has negative curvature there, or if there is no solution.
  [[nodiscard]] bool solve(Run& run, ConstVectorRef costs);
  /// z, y and λ ≤ 0 of the QP.
  [[nodiscard]] const Iterate& solution() const { return point_.x; }

 private:
  [[nodiscard]] bool solve_from_inside(Run& run);
  [[nodiscard]] bool solve_by_multipliers(Run& run);

  const ScaledProblem& problem_;
  ScaledProblem relaxed_;
  BranchPoint point_;
  SemismoothNewton newton_;
  QuadraticEngine interior_;
  ExactBranch exact_;
  const WorkingSet no_rows_;
  bool has_rows_ = false;
};

/// True if the smaller side of every pair is zero, given the rows' values.
[[nodiscard]] bool is_complementary(const RowLayout& layout, const Vector& rows);

}  // namespace marble
