// For problems without pairs and for single branches, which are convex QPs if anything: a primal-dual
// interior point method.
//
// Mehrotra's predictor and corrector (SIAM J. Optim. 2, 1992): one factorization and two solves a step. With
// w = Cz + d > 0 and ν > 0 it follows w∘ν = κ to κ → 0; equalities, fixed sides of pairs and z by proximal
// terms, which vanish where it ends. The rows that will hold at zero show long before that.
#pragma once

#include "data/residual.h"
#include "data/working_set.h"
#include "kkt/kkt.h"
#include "run/reporter.h"
#include "run/run.h"

namespace marble {

class QuadraticEngine {
 public:
  QuadraticEngine(const ScaledProblem& problem, Kkt& kkt) : QuadraticEngine(problem, kkt, problem) {}
  /// With the kkt of another problem whose rows are the same, but not which of them are pairs.
  QuadraticEngine(const ScaledProblem& problem, Kkt& kkt, const ScaledProblem& of_kkt);

  /// On this branch: of `branch` only which sides it fixes counts.
  void start(ConstVectorRef initial_z, const WorkingSet& branch);
  /// One step. False if it broke down, was too short again and again, or was interrupted: Q has negative
  /// curvature, or there is no solution.
  [[nodiscard]] bool step(Run& run);

  /// (z, y, λ = −ν).
  [[nodiscard]] const Iterate& iterate() const { return x_; }
  /// The branch, with the rows that hold at zero, w < ν.
  [[nodiscard]] const WorkingSet& set() const { return set_; }
  /// Whether these rows have settled, the same after two steps, and are others than when it was last so.
  [[nodiscard]] bool shows_new_rows();
  [[nodiscard]] double kappa() const { return kappa_; }

 private:
  void evaluate();
  [[nodiscard]] bool direction(double kappa, bool correct);
  [[nodiscard]] double longest_step() const;
  [[nodiscard]] double free_rows() const;  // and 1 where there is none
  void read_rows();
  void report(Run& run);

  const ScaledProblem& problem_;
  Kkt& kkt_;
  WorkingSet set_;
  RowWeights weights_;
  Iterate x_, d_;  // λ of the step is −dν
  Images images_;
  Vector slack_, slack_step_, product_, rate_;  // w, dw, the predictor's dw∘dν, what rows add to the gradient
  std::vector<std::uint8_t> shown_;
  double kappa_ = 0.0, step_length_ = 0.0;
  int short_steps_ = 0;  // in a row
  bool settled_ = false;
  Reporter reporter_;
};

}  // namespace marble
