// The path-following engine: Algorithm 1 of the paper, and a faster schedule on the same equations.
#pragma once

#include "path/line_search.h"
#include "path/newton.h"
#include "path/schedule.h"
#include "run/reporter.h"
#include "run/run.h"
#include "run/termination.h"

namespace marble {

class PathEngine {
 public:
  /// Allocates everything that run() needs.
  PathEngine(const ScaledProblem& problem, Kkt& kkt, const Options& options);

  /// Begins a new path at z (scaled).
  void start(ConstVectorRef initial_z);
  /// After a follow() that was interrupted: goes on from where that was, with the numbers of now.
  void resume();

  /// Follows the path and says why it ended; nothing if it is worth a polish now and may be followed further
  /// after: when the inner loop at κ ≤ kappa_end has ended, or the path got lost before.
  [[nodiscard]] std::optional<Ending> follow(Run& run, double kappa_end);

  /// Whether follow() is to look for a contradiction too: it ends once, with nothing, at an iterate whose
  /// multipliers suggest that the constraints contradict each other, and goes on from there the next time.
  void look_for_contradiction(bool looks) { looks_for_contradiction_ = looks; }
  /// Whether the last follow() ended so.
  [[nodiscard]] bool suspects_contradiction() const { return suspects_contradiction_; }

  /// From z, a few steps each at rising ρ < rho_end and one fixed κ: a point at which everything is soft
  /// still, and each pair leans to the side that costs less.
  void lean(Run& run, ConstVectorRef initial_z, double rho_end);

  /// Whether the last follow() broke off because it took too many steps at one κ.
  [[nodiscard]] bool is_lost() const { return lost_; }
  /// The iterate follow() ended with, or the best one where it was interrupted.
  [[nodiscard]] const Iterate& iterate() const { return x_; }
  /// Its violations (user units) and its objective (scaled).
  [[nodiscard]] const Violations& violations_at() const { return violations_; }
  /// Whether it is within the tolerances, in the user's units and in the scaled ones: where the user's are
  /// large, so that a number far from zero is below every tolerance, only the latter tell.
  [[nodiscard]] bool feasible() const;
  /// The least violated of those it has passed since start(), the one with the lowest objective of those
  /// within the tolerances. Not after an interruption: iterate() is it then.
  [[nodiscard]] const Iterate& best() const { return best_; }
  [[nodiscard]] const Violations& best_violations() const { return best_violations_; }
  [[nodiscard]] double best_objective() const { return best_objective_; }
  [[nodiscard]] double objective() const { return images_.objective; }
  /// κ, ρ and the estimates at hand, and δ of the last step.
  [[nodiscard]] const Subproblem& subproblem() const { return sub_; }
  [[nodiscard]] double regularization() const { return regularization_.current(); }

 private:
  void evaluate();
  [[nodiscard]] bool solved() const;
  [[nodiscard]] bool solved_afresh();
  [[nodiscard]] Ending end_as_printed();
  void begin_subproblem(Run& run);
  [[nodiscard]] bool lost(bool last_resort);
  [[nodiscard]] bool retreat();
  [[nodiscard]] bool shows_contradiction() const;
  [[nodiscard]] Ending give_best(Status reason);
  [[nodiscard]] Ending explain(bool stalled) const;
  [[nodiscard]] bool step(Run& run);
  [[nodiscard]] double search();
  void accept(double alpha);
  void report(Run& run);
  void remember_best();
  [[nodiscard]] double primal_residual() const;

  const ScaledProblem& problem_;
  const Options& options_;
  Newton newton_;
  Subproblem sub_;
  Schedule schedule_;
  Regularization regularization_;
  FilterLineSearch filter_;
  StallDetector stall_;
  Iterate x_, r_, d_, best_;
  Iterate inner_solution_;             // where the last inner loop ended, to come back to
  double inner_solution_kappa_ = 0.0;  // its κ; 0 while there is none
  int inner_steps_ = 0;
  bool leaning_ = false;  // the estimates stay 0
  bool lost_ = false;
  bool looks_for_contradiction_ = false, suspects_contradiction_ = false;
  Images images_, direction_images_;
  Violations violations_, best_violations_;
  double best_objective_ = 0.0;
  bool has_best_ = false;
  double residual_norm_ = 0.0, step_length_ = 0.0;
  Reporter reporter_;
};

}  // namespace marble
