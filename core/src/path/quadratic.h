// A primal-dual interior point method for problems without pairs and for single branches, if they are convex
// QPs.
//
// Mehrotra's predictor and corrector (SIAM J. Optim. 2, 1992): one factorization and two solves per step.
// With w = Cz + d > 0 and ν > 0 it follows w∘ν = κ to κ → 0. Equalities, fixed sides of pairs and z have
// proximal terms, which vanish at the end. The rows that will be at zero are visible long before that.
//
// It also solves elastic branches: their rows are w = Cz + d + ν/ρ, and their terms in ρ and δ stay.
#pragma once

#include "kkt/kkt.h"
#include "model/residual.h"
#include "model/tuning.h"
#include "model/working_set.h"
#include "path/reporter.h"
#include "path/run.h"

namespace marble {

class QuadraticEngine {
 public:
  QuadraticEngine(const ScaledProblem& problem, Kkt& kkt) : QuadraticEngine(problem, kkt, problem) {}
  /// Uses the kkt of another problem with the same rows, which may differ in which of them are pairs.
  QuadraticEngine(const ScaledProblem& problem, Kkt& kkt, const ScaledProblem& of_kkt);

  /// Starts on this branch; only the fixed sides of `branch` are used.
  void start(ConstVectorRef initial_z, const WorkingSet& branch);
  /// Continues after an interrupted step() on its branch, with the current numbers.
  void resume();
  /// Starts on the elastic version of this branch: every violation of a row costs ½ρ·violation², and the
  /// distance to `center` ½δ·distance².
  void start_elastic(ConstVectorRef initial_z, const WorkingSet& branch, double rho, double delta,
                     ConstVectorRef center);
  /// Takes one step. Returns false if it broke down, was too short several times in a row, or was
  /// interrupted. A breakdown means that Q has negative curvature, or that there is no solution.
  [[nodiscard]] bool step(Run& run);

  /// (z, y, λ = −ν).
  [[nodiscard]] const Iterate& iterate() const { return x_; }
  /// The branch with the rows that are at zero: w < ν.
  [[nodiscard]] const WorkingSet& set() const { return set_; }
  /// True if these rows have settled, the same after two steps, and differ from those of the last time.
  [[nodiscard]] bool shows_new_rows();
  [[nodiscard]] double kappa() const { return kappa_; }

  /// Takes steps up to the run's given count of factorizations, or until κ ≈ 0. Whenever the rows have
  /// settled, and at the end, it calls solve(budget), which tries to solve the branch from iterate() and
  /// set(). Returns true if that succeeded.
  template <class Solve>
  [[nodiscard]] bool find_rows(Run& run, int last_factorization, Solve&& solve) {
    for (bool at_end = false; !at_end;) {
      if (!step(run)) return false;
      at_end = kappa_ <= tuning::roundoff || run.factorizations >= last_factorization;
      if (!at_end && !shows_new_rows()) continue;
      if (solve(at_end ? tuning::engine_budget : tuning::early_budget)) return true;
    }
    return false;
  }

 private:
  void begin(ConstVectorRef initial_z, const WorkingSet& branch);
  void evaluate();
  [[nodiscard]] bool factor(Run& run);
  [[nodiscard]] bool direction(double kappa, bool correct);
  [[nodiscard]] double longest_step() const;
  [[nodiscard]] double free_rows() const;  // 1 if there are none
  void read_rows();
  void report(Run& run);

  const ScaledProblem& problem_;
  Kkt& kkt_;
  WorkingSet set_;
  RowWeights weights_;
  Iterate x_, d_;  // λ of the step is −dν
  Images images_;
  Vector slack_, slack_step_, product_, rate_;  // w, dw, predictor's dw∘dν, gradient of rows
  Vector center_;
  double softness_ = 0.0;  // 1/ρ of an elastic branch, else 0
  std::vector<std::uint8_t> shown_;
  double kappa_ = 0.0, step_length_ = 0.0;
  int short_steps_ = 0;  // consecutive
  bool settled_ = false;
  Reporter reporter_;
};

}  // namespace marble
