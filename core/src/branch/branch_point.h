// Provides a point on a branch, the rows that it holds at zero, and the factor for these rows. The engines
// that solve a branch work on it and pass it on to each other.
#pragma once

#include "kkt/kkt.h"
#include "model/residual.h"
#include "model/working_set.h"
#include "path/run.h"

namespace marble {

class BranchPoint {
 public:
  BranchPoint(const ScaledProblem& problem, Kkt& kkt) : BranchPoint(problem, kkt, problem) {}
  /// Uses the kkt of another problem that has the same rows but may group them into pairs differently.
  BranchPoint(const ScaledProblem& problem, Kkt& kkt, const ScaledProblem& of_kkt);

  Iterate x;       ///< z, y and λ; σ and v are not used
  Images images;   ///< images of x
  WorkingSet set;  ///< which side of each pair the branch fixes, and which other rows are held

  /// Reads the branch and the active rows off an interior iterate, and starts from it.
  void start_from_path(const Iterate& iterate);
  /// Reads them off a solution and its multipliers, of this problem or a similar one.
  void start_from_solution(const Iterate& solution);
  /// Reads the branch off z: the smaller side of a pair is fixed. The other held rows are kept.
  void start_from_point(ConstVectorRef z);
  /// Restores a point and the working set that belongs to it.
  void restore(const Iterate& iterate, const WorkingSet& working_set);

  /// Factorizes for the rows held at zero. Returns false if the inertia is wrong: along a direction that
  /// keeps all of these rows, Q + δI has negative or no curvature.
  [[nodiscard]] bool factor(Run& run, double rho, double delta);
  /// Does the same before all numbers are available, with the same matrices. The next factor() uses and
  /// counts this factorization if it is for the same rows.
  void factor_ahead(Run& run, double rho, double delta);
  /// Discards the factorization ahead because the matrices have new values.
  void forget_ahead() { ahead_ = false; }
  /// True if the current factor is for these rows and these parameters.
  [[nodiscard]] bool is_factored(double rho, double delta) const;
  /// True if the current factor is for the rows held now, whichever side of a pair is the fixed one, and
  /// showed no negative curvature.
  [[nodiscard]] bool has_factor(double rho, double delta) const;
  /// Declares that the current factor belongs to matrices that differ from the problem's.
  void forget_factor() { factor_ = -1; }
  [[nodiscard]] double rho() const { return weights_.rho; }  ///< of the last factorization

  /// Computes the stationary point on the rows held at zero with the current factor, which must be for
  /// tuning::exact_rho and tuning::exact_delta, to this residual or to rounding. Returns false if there is
  /// none.
  [[nodiscard]] bool sharpen(double tolerance = 0.0);
  /// True if the last sharpen() reached its residual and the point has not moved since.
  [[nodiscard]] bool converged() const { return converged_; }
  /// Number of back-substitutions with the branch's own system and the current factor, in total.
  [[nodiscard]] std::int32_t back_substitutions() const { return back_substitutions_; }
  void count_back_substitutions(std::int32_t more) { back_substitutions_ += more; }
  /// Removes from a direction, with the current factor, what changes the rows held at zero.
  [[nodiscard]] bool project(VectorRef direction);

  [[nodiscard]] Kkt& kkt() { return kkt_; }

  /// Returns the largest entry of the stationarity and of the violation of fixed and free rows, scaled.
  [[nodiscard]] double error() const;
  /// Returns the violation alone.
  [[nodiscard]] double violation() const;

  /// Scratch vectors for a step of any of these methods; no value in them outlives the step.
  struct Workspace {
    explicit Workspace(const ScaledProblem& problem)
        : step(problem), images(problem), gradient(problem.variables()) {}
    Iterate step;
    Images images;  // of the step
    Vector gradient;
  };
  Workspace workspace;

 private:
  const ScaledProblem& problem_;
  Kkt& kkt_;
  RowWeights weights_;
  WorkingSet factored_set_;
  std::int64_t factor_ = -1;  // number of the factorization in kkt_, which other engines use too
  bool convex_ = false;       // it had the right inertia
  bool ahead_ = false;        // it was made for a later factor()
  bool converged_ = false;
  std::int32_t back_substitutions_ = 0;
};

}  // namespace marble
