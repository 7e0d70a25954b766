// Solves the elastic version of a branch: every violation of a row costs ½ρ·violation². It always has a
// solution, which a small proximal term makes unique.
#pragma once

#include "branch/semismooth_newton.h"
#include "path/quadratic.h"

namespace marble {

class ElasticRelaxation {
 public:
  /// Works on `point`; `newton` must use the same point.
  ElasticRelaxation(const ScaledProblem& problem, BranchPoint& point, SemismoothNewton& newton,
                    QuadraticEngine& interior);

  /// The rows that the solve starts with.
  enum class Rows {
    held,      ///< those that the point holds, assumed to be right: one factorization confirms it if they are
    violated,  ///< the fixed sides, and those that z violates
  };
  /// Solves the current branch from the current point. Returns true if solved; the current factor then
  /// belongs to this solution. If so many rows change that Newton's method does not end soon, an interior
  /// point method gets the rest of `budget`.
  [[nodiscard]] bool solve(Run& run, double rho, Rows rows, int budget);
  /// Sets the centre of the proximal term of solve(): the current point, or 0. From an exact solution, the
  /// first keeps variables without cost in place, and with them most active rows.
  void anchor_here() { anchor_ = point_.x.z(); }
  void anchor_at_zero() { anchor_.setZero(); }

  /// Returns the objective after solve(), including the cost of all violations and the proximal term.
  [[nodiscard]] double objective() const { return objective_; }
  [[nodiscard]] double rho() const { return point_.rho(); }
  [[nodiscard]] BranchPoint& point() { return point_; }
  [[nodiscard]] const BranchPoint& point() const { return point_; }

 private:
  [[nodiscard]] bool solve_by_interior(Run& run, const SemismoothNewton::Penalty& penalty, int last);

  const ScaledProblem& problem_;
  BranchPoint& point_;
  SemismoothNewton& newton_;
  QuadraticEngine& interior_;
  Vector anchor_;
  double objective_ = 0.0;
};

}  // namespace marble
