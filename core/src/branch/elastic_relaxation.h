// The elastic version of a branch: every violation of a row costs ½ρ·violation². It always has a solution,
// one only thanks to a small proximal term.
#pragma once

#include "branch/semismooth_newton.h"
#include "path/quadratic.h"

namespace marble {

class ElasticRelaxation {
 public:
  /// Works on `point`; `newton` must too.
  ElasticRelaxation(const ScaledProblem& problem, BranchPoint& point, SemismoothNewton& newton,
                    QuadraticEngine& interior);

  /// Where the rows come from that it begins with.
  enum class Rows {
    held,      ///< those the point holds, taken to be right: one factorization proves it if they are
    violated,  ///< the fixed sides, and those that z violates
  };
  /// Solves it for the branch at hand from the point at hand. True if solved; the factor at hand is then the
  /// one of this solution. Where so many rows change that Newton's method has not ended soon, an interior
  /// point method has the rest of `budget`.
  [[nodiscard]] bool solve(Run& run, double rho, Rows rows, int budget);
  /// Where the proximal term of solve() pulls: to the point at hand, or to 0. From an exact solution the
  /// first leaves variables without cost where they are, and with them most active rows.
  void anchor_here() { anchor_ = point_.x.z(); }
  void anchor_at_zero() { anchor_.setZero(); }

  /// After solve(): the objective with the cost of all violations and the proximal term.
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
