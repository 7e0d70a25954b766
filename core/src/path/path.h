// The path-following engine: Algorithm 1 of the paper, and a faster schedule for the same equations.
#pragma once

#include "path/certificate.h"
#include "path/line_search.h"
#include "path/newton.h"
#include "path/reporter.h"
#include "path/run.h"
#include "path/schedule.h"
#include "path/termination.h"

namespace marble {

class PathEngine {
 public:
  /// Allocates everything that follow() needs.
  PathEngine(const ScaledProblem& problem, Kkt& kkt, const Options& options);

  /// Begins a new path at z (scaled).
  void start(ConstVectorRef initial_z);
  /// Continues an interrupted follow() from its point, with the current numbers.
  void resume();

  /// Follows the path and returns why it ended. Returns nothing if a polish is worth trying and the path may
  /// be followed further: when the inner loop at κ ≤ kappa_end has ended, or the path stalled before.
  [[nodiscard]] std::optional<Ending> follow(Run& run, double kappa_end);

  /// If `looks`, follow() also looks for a contradiction: it ends once, with nothing, at an iterate whose
  /// multipliers suggest that the constraints contradict each other. The next call continues from there.
  void look_for_contradiction(bool looks) { looks_for_contradiction_ = looks; }
  /// True if the last follow() ended for that reason.
  [[nodiscard]] bool suspects_contradiction() const { return suspects_contradiction_; }

  /// Takes a few steps each at increasing ρ < rho_end and one fixed κ, from z. At the resulting point
  /// everything is still soft, and each pair is biased to the side that costs less.
  void lean(Run& run, ConstVectorRef initial_z, double rho_end);

  /// True if the last follow() ended because it took too many steps at one κ (stalled).
  [[nodiscard]] bool is_lost() const { return lost_; }
  /// The last iterate of follow(), or the best one if it was interrupted.
  [[nodiscard]] const Iterate& iterate() const { return x_; }
  /// Its violations (user units); objective() is its objective (scaled).
  [[nodiscard]] const Violations& violations_at() const { return violations_; }
  /// True if it is within the tolerances in the user's units and in the scaled ones. If the user's units are
  /// large, so that numbers far from zero are within every tolerance, only the scaled units are informative.
  [[nodiscard]] bool feasible() const;
  /// The least violated iterate since start() or, among those within the tolerances, the one with the lowest
  /// objective. Not after an interruption, when it is iterate().
  [[nodiscard]] const Iterate& best() const { return best_; }
  [[nodiscard]] const Violations& best_violations() const { return best_violations_; }
  [[nodiscard]] double best_objective() const { return best_objective_; }
  [[nodiscard]] double objective() const { return images_.objective; }
  /// The current κ, ρ and estimates; regularization() is δ of the last step.
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
  [[nodiscard]] bool shows_contradiction();
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
  Iterate inner_solution_;             // the point of the last inner loop, to return to
  double inner_solution_kappa_ = 0.0;  // its κ; 0 if there is none
  int inner_steps_ = 0;
  bool leaning_ = false;  // the estimates stay 0
  bool lost_ = false;
  bool looks_for_contradiction_ = false, suspects_contradiction_ = false;
  ContradictionScreen screen_;
  Images images_, direction_images_;
  Violations violations_, best_violations_;
  double best_objective_ = 0.0;
  bool has_best_ = false;
  double residual_norm_ = 0.0, step_length_ = 0.0;
  Reporter reporter_;
};

}  // namespace marble
