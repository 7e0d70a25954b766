// How an answer changes with its problem: derivatives of z and of the multipliers by every number of it.
//
//   auto sensitivity = marble::Sensitivity::create(problem, answer);
//   auto change = sensitivity->along({.b = measured});            // forward: of the answer, by these numbers
//   auto gradient = sensitivity->gradient({.z = loss_by_z});      // adjoint: of a loss, by all numbers
#pragma once

#include <memory>
#include <vector>

#include "marble/derivatives.h"
#include "marble/error.h"
#include "marble/problem.h"
#include "marble/solution.h"

namespace marble {

/// The branch of an answer and its factor. On the branch the answer solves
///
///   [ Q   Aᵀ  J₀ᵀ ] [ z ]   [ −g ]
///   [ A            ] [ y ] = [ −b ]        J₀: the rows of [C; L; R] that are zero, c₀ their offsets, λ =
///   −(ν, ξ, η) [ J₀           ] [ λ ]   [−c₀ ]
///
/// whose derivative is one more solution of it a direction: two or three back-substitutions, no
/// factorization. SolveControls::sensitivity asks the same of a solver, which has the factor already. One
/// thread at a time.
class Sensitivity {
 public:
  /// Scales, analyses and factorizes the branch of `answer` once. Keeps nothing of the problem's arrays.
  /// Errors: invalid_argument of field "solution.z" and such (other sizes, not finite); failed_precondition
  /// of field "solution" where it is not solved, or no isolated exact solution of its branch.
  [[nodiscard]] static Expected<Sensitivity> create(const Problem& problem, const Solution& answer);

  /// What was moved from may only be assigned to or destroyed.
  Sensitivity(Sensitivity&&) noexcept;
  /// As the constructor.
  Sensitivity& operator=(Sensitivity&&) noexcept;
  ~Sensitivity();

  /// The change by a direction: new numbers less the old ones. What is absent stays as it is. Errors:
  /// invalid_argument as PartSizes::check names the fields; failed_precondition of field "direction" where
  /// the branch's rows depend on each other and contradict along it, or what they leave is flat.
  [[nodiscard]] Expected<AnswerChange> along(const ProblemUpdate& direction);

  /// The gradient of a loss: every number's at once, for one solution of the system. Where not is_smooth() it
  /// is the branch's, one of several. Errors: as along(), fields "weights.z" and such.
  [[nodiscard]] Expected<ProblemGradient> gradient(const AnswerWeights& weights);

  /// How rows E z follow a price on them. Errors: invalid_argument, fields "rows.E.values" and such;
  /// failed_precondition of field "rows" where the branch is flat along one, or not convex without proximal.
  [[nodiscard]] Expected<RowResponse> rows(const RowsRequest& request);

  /// As SensitivityAnswer has them.
  [[nodiscard]] const std::vector<Index>& weak_inequalities() const;
  /// As SensitivityAnswer has them.
  [[nodiscard]] const std::vector<Index>& biactive_pairs() const;
  /// By all that was asked so far.
  [[nodiscard]] std::int32_t factorizations() const;
  /// By all that was asked so far.
  [[nodiscard]] std::int32_t back_substitutions() const;
  /// Whether there are none of both: derivatives hold in all directions, both ways.
  [[nodiscard]] bool is_smooth() const { return weak_inequalities().empty() && biactive_pairs().empty(); }

 private:
  struct State;
  explicit Sensitivity(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace marble
