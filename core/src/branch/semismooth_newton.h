// Minimises the proximal augmented Lagrangian of a branch, a convex piecewise quadratic of z:
//
//   f(z) + ½δ‖z − z_c‖² + Σ ½ρ(c(z) + α/ρ)²   over equalities and fixed sides,
//                         with min(0, ·) inside the square over free rows.
//
// Semismooth Newton: each step is to the minimum for the rows that are below zero, by one factorization, as
// long as an exact line search along it says. That ends where no row changes any more.
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

  /// To the minimum, from the point's z, with the run's count of factorizations up to `last`. False if that
  /// is not enough, or if Q has negative curvature there. The point's rows held are then those below zero,
  /// and its multipliers α + ρc of these.
  [[nodiscard]] bool minimize(Run& run, const Penalty& penalty, int last);
  /// The same where the rows held are taken to be right: one step proves it if they are, with the factor at
  /// hand if it is theirs.
  [[nodiscard]] bool minimize_from_rows(Run& run, const Penalty& penalty, int last);
  /// The proximal method of multipliers, from the center: minimises, then α ← λ and z_c ← z, until neither
  /// moves. False if the branch seems infeasible, or as above.
  [[nodiscard]] bool converge(Run& run, const Penalty& penalty, int last);
  /// Whether that ended at a step that did not descend: δ is lost in rounding beside ρ where Q is flat.
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
  Vector unclipped_;  // α + ρc of all rows; the multipliers are 0 where a free row is not below zero
  struct Breakpoint {
    double step, slope;
  };
  std::vector<Breakpoint> breakpoints_;
  bool lost_descent_ = false;
};

}  // namespace marble
