// Minimises the proximal augmented Lagrangian of a branch, a convex piecewise quadratic of z:
//
//   f(z) + ½δ‖z − z_c‖² + Σ ½ρ(c(z) + α/ρ)²   over equalities and fixed sides,
//                         with min(0, ·) inside the square over free rows.
//
// Semismooth Newton: each step goes towards the minimum for the rows that are below zero, by one
// factorization, with a length from an exact line search. The method ends when no row changes any more.
#pragma once

#include <vector>

#include "branch/branch_point.h"

namespace marble {

class SemismoothNewton {
 public:
  /// Works on `point`.
  SemismoothNewton(const ScaledProblem& problem, Kkt& kkt, BranchPoint& point);

  struct Penalty {
    double rho, delta;
  };
  Iterate center;  ///< z_c, and α as its y and λ

  /// Minimizes from the point's z until the run's count of factorizations reaches `last`. Returns false if
  /// that is not enough, or if Q has negative curvature there. The point then holds the rows that are below
  /// zero, and its multipliers are α + ρc of these rows.
  [[nodiscard]] bool minimize(Run& run, const Penalty& penalty, int last);
  /// The same if the held rows are assumed to be right: one step confirms it if they are, with the current
  /// factor if it belongs to them.
  [[nodiscard]] bool minimize_from_rows(Run& run, const Penalty& penalty, int last);
  /// Runs the proximal method of multipliers from the center: minimizes, then sets α ← λ and z_c ← z, until
  /// neither changes. Returns false if the branch seems infeasible, or as above.
  [[nodiscard]] bool converge(Run& run, const Penalty& penalty, int last);
  /// True if the last solve ended at a step without descent: where Q is flat, δ is lost in rounding beside ρ.
  [[nodiscard]] bool lost_descent() const { return lost_descent_; }

 private:
  [[nodiscard]] bool iterate(Run& run, const Penalty& penalty, int last, bool full_step);
  [[nodiscard]] bool find_step();
  [[nodiscard]] bool move(const Penalty& penalty, double length);
  void evaluate_multipliers(const Penalty& penalty);
  void choose_rows(const Penalty& penalty);
  void evaluate_gradient(const Penalty& penalty);
  [[nodiscard]] double exact_length(const Penalty& penalty);

  const ScaledProblem& problem_;
  Kkt& kkt_;
  BranchPoint& point_;
  Vector unclipped_;  // α + ρc of all rows; the multiplier of a free row that is not below zero is 0
  struct Breakpoint {
    double step, slope;
  };
  std::vector<Breakpoint> breakpoints_;
  bool lost_descent_ = false;
};

}  // namespace marble
