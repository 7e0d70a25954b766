// The second engine, for problems whose path ends infeasible: an interior point method.
//
// It keeps s, t > 0 and follows s∘t = κ, linearized as t ds + s dt = κ − st, to κ → 0 with a proximal term 3κ
// on z. That constraint is never softened, so t cannot drift away along −κ log, as it can on the path at
// finite ρ. The final point need not be feasible either, but its branch is near a feasible one.
#pragma once

#include "kkt/kkt.h"
#include "model/residual.h"
#include "path/reporter.h"
#include "path/run.h"

namespace marble {

class InteriorEngine {
 public:
  InteriorEngine(const ScaledProblem& problem, Kkt& kkt);

  /// Follows κ from z (scaled) to its end, or as far as possible. Returns false if it broke down at once or
  /// was interrupted: a later run may then resume at the same point, with the numbers current at that time.
  [[nodiscard]] bool run(Run& run, ConstVectorRef initial_z, bool resumes = false);

  [[nodiscard]] auto z() const { return x_.z(); }

 private:
  void start(ConstVectorRef initial_z);
  void evaluate();
  void weigh();
  [[nodiscard]] double step(Run& run);
  [[nodiscard]] double move();
  void report(Run& run);

  const ScaledProblem& problem_;
  Kkt& kkt_;
  RowWeights weights_;
  Iterate x_, d_;
  Images images_;
  RowVector slack_;  // w of the inequalities, s and t of the pairs
  RowVector slack_step_;
  Vector nu_;  // multipliers of the inequalities
  RowVector rhs_;
  Vector gradient_;
  double kappa_ = 0.0, step_length_ = 0.0, primal_residual_ = 0.0;
  Reporter reporter_;
};

}  // namespace marble
