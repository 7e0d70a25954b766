// Derivatives of a solution with respect to its problem's numbers, by the factor of the solution's branch.
#pragma once

#include <cstdint>
#include <vector>

#include "branch/branch_system.h"
#include "kkt/batch.h"
#include "marble/sensitivity.h"

namespace marble {

/// Returns an error if a solution with this status cannot have derivatives.
[[nodiscard]] Expected<void> must_be_solved(Status status);

/// All arguments must have passed check(). The class changes the problem temporarily while it computes rows
/// without their proximal term, and restores it afterwards.
class BranchDerivatives {
 public:
  BranchDerivatives(ScaledProblem& problem, const PartSizes& sizes, BranchPoint& point);

  /// Reads the branch off a solution and factorizes for it, unless the current factor matches and may be
  /// used. Errors, as in all functions of this class: failed_precondition; field "solution" if the solution
  /// is not an isolated exact solution of a branch, or if the run is over.
  [[nodiscard]] Expected<void> begin(Run& run, const Iterate& solution, bool may_reuse_factor);

  [[nodiscard]] Expected<AnswerChanges> along(Run& run, const DirectionsRequest& directions);
  [[nodiscard]] Expected<ProblemGradients> gradients(Run& run, const LossesRequest& losses);
  [[nodiscard]] Expected<RowResponse> rows(Run& run, const RowsRequest& request);
  /// Computes the whole request, except for its counters.
  [[nodiscard]] Expected<SensitivityAnswer> answer(Run& run, const SensitivityRequest& request);

  [[nodiscard]] const std::vector<Index>& weak_inequalities() const { return weak_inequalities_; }
  [[nodiscard]] const std::vector<Index>& biactive_pairs() const { return biactive_pairs_; }

 private:
  [[nodiscard]] Expected<void> factor(Run& run);
  [[nodiscard]] Expected<void> make_ready(Run& run);
  void hold_wrong_signs(const Iterate& solution);
  void find_weak_rows();
  [[nodiscard]] Expected<RowResponse> respond(Run& run, const RowsRequest& request);
  template <class T>
  void take_directions(const ProblemUpdate& by, const Batch<T>& batch, BranchSystem<T>& system) const;
  template <class T>
  void take_losses(const AnswerWeights& weights, const Batch<T>& batch, BranchSystem<T>& system) const;
  template <class T>
  void find_changes(const ProblemUpdate& by, const Batch<T>& batch, AnswerChanges& changes);
  template <class T>
  void find_gradients(const AnswerWeights& weights, const Batch<T>& batch, ProblemGradients& gradients);
  template <class T>
  [[nodiscard]] bool find_response(const RowMatrix& e, const Batch<T>& batch, RowResponse& response);
  template <class T>
  void report_constant_active_sets(const BranchSystem<T>& system, const std::vector<T>& by_direction,
                                   const Batch<T>& batch,
                                   std::vector<std::uint8_t>& active_set_constant) const;

  ScaledProblem& problem_;
  const PartSizes sizes_;
  BranchPoint& point_;
  BranchSystemMemory memory_;
  Vector x_z_, x_y_, x_lambda_;  // the solution, in the user's units
  std::vector<Index> weak_inequalities_, biactive_pairs_;
  std::vector<Index> weak_rows_;  // rows of both that are weakly active, by number in [C; L; R]
};

}  // namespace marble
