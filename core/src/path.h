// The path-following engine: Algorithm 1 of the paper, and a faster schedule on the same equations.
#pragma once

#include "line_search.h"
#include "newton.h"
#include "run.h"
#include "schedule.h"
#include "termination.h"

namespace marble {

class PathEngine {
 public:
  /// Allocates everything that run() needs.
  PathEngine(const ScaledProblem& problem, Kkt& kkt, const Options& options);

  /// Follows the path from z (scaled) until it ends, and says why.
  Ending run(ConstVectorRef initial_z, Run& run);

  /// The iterate run() ended with, or the best one where it was interrupted.
  [[nodiscard]] const Iterate& iterate() const { return x_; }
  [[nodiscard]] double kappa() const { return sub_.kappa; }

 private:
  void start(ConstVectorRef initial_z);
  [[nodiscard]] bool step(Run& run);
  [[nodiscard]] double search();
  void accept(double alpha);
  void report(Run& run) const;
  void remember_best();
  [[nodiscard]] double primal_residual() const;
  void mark_inner_solution();
  [[nodiscard]] bool retreat();

  const ScaledProblem& problem_;
  const Options& options_;
  Newton newton_;
  Subproblem sub_;
  Schedule schedule_;
  Regularization regularization_;
  FilterLineSearch filter_;
  Iterate x_, r_, d_, best_;
  Iterate inner_solution_;             // where the last inner loop ended, to come back to
  double inner_solution_kappa_ = 0.0;  // its κ; 0 while there is none
  int inner_steps_ = 0;
  Images images_, direction_images_;
  Violations violations_, best_violations_;
  double best_objective_ = 0.0;
  bool has_best_ = false;
  double residual_norm_ = 0.0, step_length_ = 0.0;
  mutable Vector reported_z_;
};

}  // namespace marble
