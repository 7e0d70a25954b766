// A point on a branch, with the rows that it holds at zero and the factor of what they leave: what the ways
// to solve a branch work on, and hand to each other.
#pragma once

#include "data/residual.h"
#include "data/working_set.h"
#include "kkt/kkt.h"
#include "run/run.h"

namespace marble {

class BranchPoint {
 public:
  BranchPoint(const ScaledProblem& problem, Kkt& kkt) : BranchPoint(problem, kkt, problem) {}
  /// With the kkt of another problem whose rows are the same, but not which of them are pairs.
  BranchPoint(const ScaledProblem& problem, Kkt& kkt, const ScaledProblem& of_kkt);

  Iterate x;       ///< z, y and λ; σ and v are not used
  Images images;   ///< of x
  WorkingSet set;  ///< which side of each pair the branch fixes, and which other rows are held

  /// Reads the branch and the active rows off an interior iterate, and starts from it.
  void start_from_path(const Iterate& iterate);
  /// Reads them off a solution and its multipliers, of this problem or one like it.
  void start_from_solution(const Iterate& solution);
  /// Reads the branch off z: the smaller side of a pair is fixed. Which other rows are held stays.
  void start_from_point(ConstVectorRef z);
  /// Goes back to a point, with the working set it had then.
  void restore(const Iterate& iterate, const WorkingSet& working_set);

  /// Factorizes for the rows held at zero. False if the inertia is wrong: Q + δI has negative curvature, or
  /// none, along a direction that keeps all of them.
  [[nodiscard]] bool factor(Run& run, double rho, double delta);
  /// The same before the numbers are all there, of the same matrices: the next factor(), if it is for the
  /// same rows, takes it over and counts it.
  void factor_ahead(Run& run, double rho, double delta);
  /// The matrices have new values.
  void forget_ahead() { ahead_ = false; }
  /// Whether the factor at hand is that, of these rows.
  [[nodiscard]] bool is_factored(double rho, double delta) const;
  /// Whether the factor at hand is of the rows held now, whichever side of a pair is the fixed one, and told
  /// no negative curvature.
  [[nodiscard]] bool has_factor(double rho, double delta) const;
  /// The factor at hand is of other matrices than the problem has.
  void forget_factor() { factor_ = -1; }
  [[nodiscard]] double rho() const { return weights_.rho; }  ///< of the last factorization

  /// With the factor at hand, of tuning::exact_rho and tuning::exact_delta: the stationary point on the rows
  /// held at zero, to this residual or as exact as rounding lets it be. False if there is none.
  [[nodiscard]] bool sharpen(double tolerance = 0.0);
  /// Whether the last one reached its residual, and nothing has moved the point since.
  [[nodiscard]] bool converged() const { return converged_; }
  /// Of the branch's own system with the factor at hand, all together.
  [[nodiscard]] std::int32_t back_substitutions() const { return back_substitutions_; }
  void count_back_substitutions(std::int32_t more) { back_substitutions_ += more; }
  /// With the factor at hand: takes out of a direction what changes the rows held at zero.
  [[nodiscard]] bool project(VectorRef direction);

  [[nodiscard]] Kkt& kkt() { return kkt_; }

  /// Largest entry of the stationarity, and of the violation of fixed and free rows, scaled.
  [[nodiscard]] double error() const;
  /// The violation alone.
  [[nodiscard]] double violation() const;

  /// What a step of any of those methods needs, and nothing reads after it.
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
  std::int64_t factor_ = -1;  // of kkt_, which others use too
  bool convex_ = false;       // it had the right inertia
  bool ahead_ = false;        // it was made for a factor() to come
  bool converged_ = false;
  std::int32_t back_substitutions_ = 0;
};

}  // namespace marble
