// The problem without complementarity, every side of a pair ≥ 0 and no more, for linear costs that change:
// what the methods solve again and again that write the pairs into the objective.
#pragma once

#include "branch/branch_engines.h"

namespace marble {

class RelaxedQp {
 public:
  RelaxedQp(const ScaledProblem& problem, Kkt& kkt);

  /// Takes the numbers that the problem has now; its next solution is looked for from z on.
  void start(ConstVectorRef z);
  /// Exactly, with g + Jᵀ·costs for its linear cost, J all rows, from the rows that the last solution held.
  /// False if Q has negative curvature there, or if there is no solution.
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

/// Whether the smaller side of every pair is zero, of the rows' values.
[[nodiscard]] bool is_complementary(const RowLayout& layout, const Vector& rows);

}  // namespace marble
