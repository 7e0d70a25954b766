// The exact solution of a branch: the convex QP that is left of the problem once each pair has one side fixed
// at zero. The other side, like every inequality, must stay ≥ 0.
//
// The primal-dual active set method: it guesses which of those hold with equality, solves the
// equality-constrained problem that leaves by one factorization, and exchanges all rows whose sign is wrong.
// Where that cycles the proximal method of multipliers, which converges for every feasible branch, tells the
// rows; where they are so many that it would take too long, an interior point method. Its own solution is the
// answer where rows that are weakly active leave what is flat, so that no choice of them gives it back.
#pragma once

#include <optional>

#include "branch/semismooth_newton.h"
#include "path/quadratic.h"

namespace marble {

class ExactBranch {
 public:
  /// Works on `point`; `newton` must too.
  ExactBranch(BranchPoint& point, SemismoothNewton& newton, QuadraticEngine& interior);

  /// Solves the branch at hand to full accuracy with at most `budget` factorizations. True if it succeeded:
  /// the point then satisfies the branch's optimality conditions to rounding, with every sign right but those
  /// of the fixed sides. After the interior point method's own solution a row that is not held may have a
  /// multiplier: its product with the slack is rounding.
  [[nodiscard]] bool solve(Run& run, int budget);

  /// Takes the solution that an interior point method on the branch has converged to, if it has: where rows
  /// are weakly active, and what they leave is flat, no choice of rows gives it back.
  [[nodiscard]] bool take_interior(const QuadraticEngine& engine);

  [[nodiscard]] BranchPoint& point() { return point_; }

 private:
  [[nodiscard]] std::optional<bool> exchange_rows(Run& run, int rounds, int last);
  [[nodiscard]] bool exchange();
  [[nodiscard]] bool solve_by_interior(Run& run, int last);

  BranchPoint& point_;
  SemismoothNewton& newton_;
  QuadraticEngine& interior_;
};

}  // namespace marble
