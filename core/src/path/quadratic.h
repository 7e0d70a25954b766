// For problems without pairs and for single branches, which are convex QPs if anything: a primal-dual
// interior point method.
//
// Mehrotra's predictor and corrector (SIAM J. Optim. 2, 1992): one factorization and two solves a step. With
// w = Cz + d > 0 and ν > 0 it follows w∘ν = κ to κ → 0; equalities, fixed sides of pairs and z by proximal
// terms, which vanish where it ends. The rows that will hold at zero show long before that.
//
// Of an elastic branch the same: its rows are w = Cz + d + ν/ρ, and its terms in ρ and δ stay.
#pragma once

#include "data/residual.h"
#include "data/working_set.h"
#include "kkt/kkt.h"
#include "run/reporter.h"
#include "run/run.h"
#include "tuning.h"

namespace marble {

class QuadraticEngine {
 public:
  QuadraticEngine(const ScaledProblem& problem, Kkt& kkt) : QuadraticEngine(problem, kkt, problem) {}
  /// With the kkt of another problem whose rows are the same, but not which of them are pairs.
  QuadraticEngine(const ScaledProblem& problem, Kkt& kkt, const ScaledProblem& of_kkt);

  /// On this branch: of `branch` only which sides it fixes counts.
  void start(ConstVectorRef initial_z, const WorkingSet& branch);
  /// After a step() that was interrupted: goes on from there, on its branch, with the numbers of now.
  void resume();
  /// On the elastic version of this branch: every violation of a row costs ½ρ·violation², and every distance
  /// from `center` ½δ·distance².
  void start_elastic(ConstVectorRef initial_z, const WorkingSet& branch, double rho, double delta,
                     ConstVectorRef center);
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

  /// Steps up to the run's given count of factorizations, and at the latest to κ ≈ 0. Whenever the rows have
  /// settled, and at the end, solve(budget) is asked whether it could solve the branch with iterate() and
  /// set(). True if it could.
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
  Vector center_;
  double softness_ = 0.0;  // 1/ρ of an elastic branch, else 0
  std::vector<std::uint8_t> shown_;
  double kappa_ = 0.0, step_length_ = 0.0;
  int short_steps_ = 0;  // in a row
  bool settled_ = false;
  Reporter reporter_;
};

}  // namespace marble
