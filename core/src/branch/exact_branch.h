// Computes the exact solution of a branch: the convex QP that remains once each pair has one side fixed at
// zero. The other side, like every inequality, must stay ≥ 0.
//
// The primal-dual active set method guesses which of these rows hold with equality, solves the resulting
// equality-constrained problem by one factorization, and exchanges all rows whose sign is wrong. If it
// cycles, the proximal method of multipliers, which converges for every feasible branch, determines the rows.
// If that would take too long because there are many rows, an interior point method does. Its own solution is
// the result if the branch is flat apart from weakly active rows, so that no choice of rows reproduces it.
#pragma once

#include <optional>
#include <vector>

#include "branch/parametric.h"
#include "branch/semismooth_newton.h"
#include "path/quadratic.h"

namespace marble {

class ExactBranch {
 public:
  /// Works on `point`; `newton` must use the same point.
  ExactBranch(BranchPoint& point, SemismoothNewton& newton, QuadraticEngine& interior);

  /// Solves the current branch to full accuracy with at most `budget` factorizations. Returns true on
  /// success: the point then satisfies the branch's optimality conditions to rounding, and every sign is
  /// right except those of the fixed sides. If the interior point method's own solution is taken, a row that
  /// is not held may have a multiplier: its product with the slack is rounding. Pass a `parametric` if the
  /// point solves the branch for similar numbers: it follows their change, instead of exchanges of rows.
  [[nodiscard]] bool solve(Run& run, int budget, Parametric* parametric = nullptr);

  /// Takes the solution that an interior point method on the branch has converged to, if it has converged. It
  /// is needed if the branch is flat apart from weakly active rows, so that no choice of rows reproduces it.
  [[nodiscard]] bool take_interior(const QuadraticEngine& engine);

  [[nodiscard]] BranchPoint& point() { return point_; }

 private:
  [[nodiscard]] std::optional<bool> exchange_rows(Run& run, int rounds, int last,
                                                  Parametric* parametric = nullptr);
  [[nodiscard]] bool factor(Run& run, int last);
  void find_wrong_rows();
  [[nodiscard]] bool solve_by_interior(Run& run, int last);

  BranchPoint& point_;
  SemismoothNewton& newton_;
  QuadraticEngine& interior_;
  std::vector<Index> wrong_rows_;  // active with a wrong-sign multiplier, or inactive and violated
};

}  // namespace marble
