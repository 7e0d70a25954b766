// How a solution changes with its problem's numbers, by the factor of the branch it is on.
#pragma once

#include <optional>

#include "branch/branch_point.h"
#include "marble/sensitivity.h"

namespace marble {

/// Whether an answer of this status can have derivatives.
[[nodiscard]] Expected<void> must_be_solved(Status status);

/// Everything that is asked must have passed check(). The problem is changed while rows without their
/// proximal term are looked at, and is as it was afterwards.
class BranchDerivatives {
 public:
  BranchDerivatives(ScaledProblem& problem, const PartSizes& sizes, BranchPoint& point);

  /// Reads the branch off a solution and factorizes for it, unless the factor at hand is that and may be
  /// used. Errors, like all here: failed_precondition; of field "solution" where it is no isolated exact
  /// solution of a branch, or the run is over.
  [[nodiscard]] Expected<void> begin(Run& run, const Iterate& solution, bool may_reuse_factor);

  [[nodiscard]] Expected<AnswerChange> along(Run& run, const ProblemUpdate& direction);
  [[nodiscard]] Expected<ProblemGradient> gradient(Run& run, const AnswerWeights& weights);
  [[nodiscard]] Expected<RowResponse> rows(Run& run, const RowsRequest& request);
  /// All of a request, but for its counters.
  [[nodiscard]] Expected<SensitivityAnswer> answer(Run& run, const SensitivityRequest& request);

  [[nodiscard]] const std::vector<Index>& weak_inequalities() const { return weak_inequalities_; }
  [[nodiscard]] const std::vector<Index>& biactive_pairs() const { return biactive_pairs_; }

 private:
  // A vector of the system in the user's units.
  struct Unscaled {
    Vector z, y, lambda;
  };
  [[nodiscard]] Unscaled unscaled(const Iterate& x) const;
  [[nodiscard]] Expected<void> factor(Run& run);
  [[nodiscard]] Expected<void> make_ready(Run& run);
  void find_weak_rows();
  [[nodiscard]] AnswerChange no_change() const;
  [[nodiscard]] ProblemGradient no_gradient() const;
  [[nodiscard]] bool holds(const Images& by_direction);
  [[nodiscard]] Expected<RowResponse> respond(Run& run, const RowsRequest& request);

  ScaledProblem& problem_;
  const PartSizes sizes_;
  BranchPoint& point_;
  Iterate right_, found_;  // of the scaled system
  Images moved_;
  std::optional<ScaledProblem> direction_;  // a problem of the same pattern, made of a direction's numbers
  std::vector<Index> weak_inequalities_, biactive_pairs_;
  std::vector<Index> weak_rows_;  // of both, by their number in [C; L; R]
};

}  // namespace marble
