// The products of the pairs as a cost that grows: a homotopy from the relaxation without complementarity.
//
// With all sides of pairs ≥ 0 and no more, z goes to the minimum of f + π sᵀt along the step to the minimum
// of f + π times what sᵀt is to first order, while the penalty π rises (sequential convex programming;
// LCQPow, Hall, Nurkanović, Messerer and Diehl 2022). From QP to QP only the gradient changes: each begins
// with the rows that the last one held. Where these are far off, an interior point method finds them.
#pragma once

#include "branch/semismooth_newton.h"
#include "path/quadratic.h"

namespace marble {

class PenaltyHomotopy {
 public:
  PenaltyHomotopy(const ScaledProblem& problem, Kkt& kkt);

  /// From a point, with the run's count of factorizations up to `last`. False if it has not come to a point
  /// whose pairs are nearly complementary; soon, where the first penalty changes little.
  [[nodiscard]] bool run(Run& run, ConstVectorRef initial_z, int last);
  [[nodiscard]] const Vector& z() const { return z_; }
  /// Where the last run ended.
  [[nodiscard]] double penalty() const { return penalty_; }

  /// Memory of one, for a problem with so many entries and an iterate of this length.
  [[nodiscard]] static double bytes(double entries, double iterate);
  /// Whether problems with so many pairs are worth one.
  [[nodiscard]] static bool applies(Index pairs);

 private:
  [[nodiscard]] bool solve(Run& run, int last);
  [[nodiscard]] bool solve_from_inside(Run& run, int last);
  void linearize();
  [[nodiscard]] double step();
  [[nodiscard]] double products() const;
  [[nodiscard]] bool is_complementary() const;

  const ScaledProblem& problem_;
  ScaledProblem relaxed_;  // every side of a pair is an inequality; its g changes from QP to QP
  BranchPoint point_;
  SemismoothNewton newton_;
  QuadraticEngine interior_;
  const WorkingSet no_rows_;
  Vector z_, step_, gradient_, rows_, rates_;
  double penalty_ = 0.0;
};

}  // namespace marble
