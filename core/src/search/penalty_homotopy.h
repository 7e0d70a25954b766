// The products of the pairs as a growing cost: a homotopy from the relaxation without complementarity.
//
// The only constraints on pairs are that all sides are ≥ 0. z moves to the minimum of f + π sᵀt along the
// step to the minimum of f + π times the linearization of sᵀt, while the penalty π rises (sequential convex
// programming; LCQPow, Hall, Nurkanović, Messerer and Diehl 2022). Only the gradient changes from QP to QP:
// each begins with the rows that the last one held. If these are far off, an interior point method finds
// them.
#pragma once

#include "branch/semismooth_newton.h"
#include "path/quadratic.h"

namespace marble {

class PenaltyHomotopy {
 public:
  PenaltyHomotopy(const ScaledProblem& problem, Kkt& kkt);

  /// Runs the homotopy from a point, with the run's count of factorizations up to `last`. Returns false if it
  /// did not reach a point whose pairs are nearly complementary; it ends soon if the first penalty changes
  /// little.
  [[nodiscard]] bool run(Run& run, ConstVectorRef initial_z, int last);
  [[nodiscard]] const Vector& z() const { return z_; }
  /// The penalty at which the last run ended.
  [[nodiscard]] double penalty() const { return penalty_; }

  /// Returns the memory of a homotopy for a problem with this number of entries and an iterate of this
  /// length.
  [[nodiscard]] static double bytes(double entries, double iterate);
  /// True if a homotopy is worthwhile for this number of pairs.
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
