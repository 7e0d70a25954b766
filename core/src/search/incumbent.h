// The best exact solution of a branch so far, over all stages of a solve.
#pragma once

#include "branch/exact_branch.h"
#include "marble/options.h"
#include "path/quadratic.h"

namespace marble {

/// An exact solution of a feasible branch.
struct ExactSolution {
  explicit ExactSolution(const ScaledProblem& problem) : x(problem), set(problem) {}
  Iterate x;
  WorkingSet set;
  double objective = 0.0;   ///< scaled
  Violations violations;    ///< user units
  const char* origin = "";  ///< the engines that found it
  bool converged = true;    ///< false if the residual could not be lowered to rounding
};

/// Solves the current branch exactly, as ExactBranch does. Returns false if that fails or the solution is not
/// feasible.
[[nodiscard]] bool solve_exactly(const ScaledProblem& problem, const Options& options, ExactBranch& branch,
                                 Run& run, int budget, ExactSolution& solution,
                                 Parametric* parametric = nullptr);

class Incumbent {
 public:
  Incumbent(const ScaledProblem& problem, const Options& options, ExactBranch& branch);

  /// The result of solving a branch.
  enum class Outcome {
    kept,       ///< the best so far: it replaces the incumbent
    no_better,  ///< exact, but not lower by more than rounding
    not_exact,  ///< not solved, or not feasible
  };
  /// Solves the current branch exactly and keeps the solution if it is better than the best so far.
  /// `parametric` as in ExactBranch.
  [[nodiscard]] Outcome solve_branch(Run& run, const char* origin, int budget,
                                     Parametric* parametric = nullptr);
  /// Solves a branch exactly with the rows that an interior point method, already started on it, finds.
  /// Returns true if the solution is kept. The engine may be that of the branch engines: they restart it only
  /// in the last attempt.
  [[nodiscard]] bool solve_branch(Run& run, QuadraticEngine& engine);
  /// Keeps a point with its images, exact for the rows that it holds at zero, if it is feasible and has a
  /// lower objective.
  void offer(const Iterate& x, const Images& images, const WorkingSet& set, const char* origin);
  /// False if z is so far out that its rounding alone exceeds the tolerance of pairs.
  [[nodiscard]] bool doubles_hold(ConstVectorRef z) const;
  /// Replaces the incumbent, by a swap.
  void replace(ExactSolution& better);
  /// Clears all numbers, so that bounds do not depend on earlier solves.
  void clear() {
    exists_ = false;
    best_.x.all.setZero();
    other_.x.all.setZero();
  }

  [[nodiscard]] bool exists() const { return exists_; }
  /// Requires exists(). Its objective falls with every replacement.
  [[nodiscard]] const ExactSolution& best() const { return best_; }
  /// Of the last branch that solve_branch() solved and the incumbent at that time, the one that was not kept.
  [[nodiscard]] const ExactSolution& other() const { return other_; }

 private:
  const ScaledProblem& problem_;
  const Options& options_;
  ExactBranch& branch_;
  ExactSolution best_, other_;
  bool exists_ = false;
};

}  // namespace marble
