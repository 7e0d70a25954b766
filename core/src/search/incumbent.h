// The best exact solution of a branch that the stages of a solve have found so far.
#pragma once

#include "branch/exact_branch.h"
#include "marble/options.h"
#include "path/quadratic.h"

namespace marble {

/// An exact solution of a branch that is feasible.
struct ExactSolution {
  explicit ExactSolution(const ScaledProblem& problem) : x(problem), set(problem) {}
  Iterate x;
  WorkingSet set;
  double objective = 0.0;   ///< scaled
  Violations violations;    ///< user units
  const char* origin = "";  ///< the engines that found it
  bool converged = true;    ///< false where the residual could not be lowered to rounding
};

/// Solves the branch at hand exactly. False if that fails or the solution is not feasible.
[[nodiscard]] bool solve_exactly(const ScaledProblem& problem, const Options& options, ExactBranch& branch,
                                 Run& run, int budget, ExactSolution& solution);

class Incumbent {
 public:
  Incumbent(const ScaledProblem& problem, const Options& options, ExactBranch& branch);

  /// What came of a branch that was solved.
  enum class Outcome {
    kept,       ///< the best so far: it replaces the incumbent
    no_better,  ///< exact, but not lower by more than rounding
    not_exact,  ///< it could not be solved, or is not feasible
  };
  /// Solves the branch at hand exactly and keeps what is better than the best so far.
  [[nodiscard]] Outcome solve_branch(Run& run, const char* origin, int budget);
  /// Solves a branch exactly, by the rows that an interior point method, begun on it, shows. True if it is
  /// kept. The engine may be the branch engines' own: they begin it anew only in the last try.
  [[nodiscard]] bool solve_branch(Run& run, QuadraticEngine& engine);
  /// Keeps a point with its images, exact for the rows it holds at zero, if it is feasible and lower at all.
  void offer(const Iterate& x, const Images& images, const WorkingSet& set, const char* origin);
  /// Whether z is not so far out that its rounding alone is beyond the tolerance of pairs.
  [[nodiscard]] bool doubles_hold(ConstVectorRef z) const;
  /// Replaces it, by a swap.
  void replace(ExactSolution& better);
  /// All of it, lest bounds depend on solves before this one.
  void clear() {
    exists_ = false;
    best_.x.all.setZero();
    other_.x.all.setZero();
  }

  [[nodiscard]] bool exists() const { return exists_; }
  /// While it exists; its objective falls whenever it is replaced.
  [[nodiscard]] const ExactSolution& best() const { return best_; }
  /// Of the last branch that solve_branch() solved and the incumbent of that moment, the one not kept.
  [[nodiscard]] const ExactSolution& other() const { return other_; }

 private:
  const ScaledProblem& problem_;
  const Options& options_;
  ExactBranch& branch_;
  ExactSolution best_, other_;
  bool exists_ = false;
};

}  // namespace marble
