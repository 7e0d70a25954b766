// The active-set engine: solves the convex QP that is left of the problem once every pair's zero side is
// chosen.
//
// A partition fixes one side of each pair at 0; the other side, like every inequality, must stay ≥ 0. The
// engine guesses which of those hold with equality, solves the equality-constrained problem that leaves by
// one factorization, and exchanges all rows whose sign is wrong (primal-dual active set). Where that cycles
// it falls back to a semismooth Newton method with exact line search on the proximal augmented Lagrangian,
// which converges for every convex piece. Polish, warm start and local search all use it.
#pragma once

#include <cstdint>
#include <vector>

#include "kkt.h"
#include "residual.h"
#include "run.h"
#include "working_set.h"

namespace marble {

class ActiveSet {
 public:
  ActiveSet(const ScaledProblem& problem, Kkt& kkt);

  /// Reads the partition and the active rows off an interior iterate, and starts from it.
  void start_from_path(const Iterate& iterate);
  /// Goes back to a point that solve() found, with the working set it had then.
  void restore(const Iterate& iterate, const WorkingSet& set);

  /// Solves the current piece to full accuracy with at most `budget` factorizations. True if it succeeded:
  /// x() then satisfies the piece's optimality conditions to rounding, with every sign right but those of the
  /// fixed sides.
  [[nodiscard]] bool solve(Run& run, int budget);

  /// Tiny regularization; its effect is removed by repeated solves with the same factor.
  /// Factorizes for the rows held at zero. False if the inertia is wrong: Q + δI has negative curvature, or
  /// none, along a direction that keeps all of them.
  [[nodiscard]] bool factor(Run& run, double rho, double delta);
  /// With the factor at hand, of tuning::exact_rho and tuning::exact_delta: the stationary point on the rows
  /// held at zero, as exact as rounding lets it be. False if there is none.
  [[nodiscard]] bool sharpen();
  /// With the factor at hand: takes out of a direction what changes the rows held at zero.
  [[nodiscard]] bool project(VectorRef direction);

  /// Reads them off a solution and its multipliers, of this problem or one like it.
  void start_from_solution(const Iterate& solution);
  /// Reads the partition off z: the smaller side of a pair is fixed, violated rows are active.
  void start_from_point(ConstVectorRef z);
  /// Solves the elastic version of the current piece, in which every violation costs ½ρ·violation²: it always
  /// has a solution, one only thanks to a small proximal term. With `trust_set` the active rows are taken to
  /// be right, and one factorization proves it if they are; else they are those that z violates. True if
  /// solved; the factor at hand is then the one of this solution.
  [[nodiscard]] bool relax(Run& run, double rho, bool trust_set, int budget);
  /// Where the proximal term of relax() pulls: to the point at hand, or to 0. From an exact solution the
  /// first leaves variables without cost where they are, and with them most active rows.
  void anchor_here() { anchor_ = x_.z(); }
  void anchor_at_zero() { anchor_.setZero(); }
  /// After relax(): the objective with the cost of all violations and the proximal term.
  [[nodiscard]] double elastic_objective() const { return elastic_objective_; }
  [[nodiscard]] double rho() const { return weights_.rho; }  ///< of the last factorization

  /// Other rows, same point.
  void set_working_set(const WorkingSet& set) { set_ = set; }

  [[nodiscard]] const Iterate& x() const { return x_; }  ///< z, y and λ; σ and v are not used
  [[nodiscard]] const Images& images() const { return images_; }
  [[nodiscard]] const WorkingSet& set() const { return set_; }
  /// Largest entry of the stationarity, and of the violation of fixed and free rows, at x(), scaled.
  [[nodiscard]] double error() const;

 private:
  void set_weights(double rho, double delta);
  [[nodiscard]] bool solve_equalities(double tolerance);
  [[nodiscard]] bool exchange();
  [[nodiscard]] bool augmented_lagrangian(Run& run, int budget);
  [[nodiscard]] bool minimize(Run& run, double rho, double delta, bool trust_set, int last);
  void evaluate_penalty(double rho, double delta, bool choose_rows);
  [[nodiscard]] double exact_step(double rho, double slope, double curvature);

  const ScaledProblem& problem_;
  Kkt& kkt_;
  RowWeights weights_;
  WorkingSet set_, factored_set_;
  double elastic_objective_ = 0.0;
  Iterate x_, d_, center_;
  Images images_, direction_images_;
  Vector gradient_, anchor_;
  struct Breakpoint {
    double step, slope;
  };
  std::vector<Breakpoint> breakpoints_;
};

}  // namespace marble
