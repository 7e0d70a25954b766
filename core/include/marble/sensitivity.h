// How an answer changes with its problem: derivatives of z and of the multipliers by every number of it.
//
//   auto sensitivity = marble::Sensitivity::create(problem, answer);
//   auto change = sensitivity->along({.b = measured});            // forward: of the answer, by these numbers
//   auto gradient = sensitivity->gradient({.z = loss_by_z});      // adjoint: of a loss, by all numbers
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "marble/error.h"
#include "marble/problem.h"
#include "marble/solution.h"

namespace marble {

/// Changes of an answer, by one unit of a direction.
struct AnswerChange {
  std::vector<double> z;                              ///< n
  std::vector<double> equality_multipliers;           ///< n_e
  std::vector<double> inequality_multipliers;         ///< n_i
  std::vector<double> complementarity_multipliers_L;  ///< n_c
  std::vector<double> complementarity_multipliers_R;  ///< n_c
  /// Whether the answer goes this way for small positive steps: the rows of weak_inequalities() and
  /// biactive_pairs() keep the right signs. Always true where there are none.
  bool holds = true;
};

/// Of a loss, by the vectors of an answer. What is absent is zero.
struct AnswerWeights {
  std::span<const double> z = {};                              ///< n
  std::span<const double> equality_multipliers = {};           ///< n_e
  std::span<const double> inequality_multipliers = {};         ///< n_i
  std::span<const double> complementarity_multipliers_L = {};  ///< n_c
  std::span<const double> complementarity_multipliers_R = {};  ///< n_c
};

/// Of a loss, by the numbers of a problem. Of Q by its upper entries, which stand for their mirror images
/// too; 0 of the lower ones of a full Q, which count for nothing in an update.
struct ProblemGradient {
  std::vector<double> g;  ///< n
  std::vector<double> b;  ///< n_e
  std::vector<double> d;  ///< n_i
  std::vector<double> l;  ///< n_c
  std::vector<double> r;  ///< n_c
  std::vector<double> Q;  ///< one per stored entry
  std::vector<double> A;  ///< one per stored entry
  std::vector<double> C;  ///< one per stored entry
  std::vector<double> L;  ///< one per stored entry
  std::vector<double> R;  ///< one per stored entry
};

/// The branch of an answer and its factor. On the branch the answer solves
///
///   [ Q   Aᵀ  J₀ᵀ ] [ z ]   [ −g ]
///   [ A            ] [ y ] = [ −b ]        J₀: the rows of [C; L; R] that are zero, c₀ their offsets, λ =
///   −(ν, ξ, η) [ J₀           ] [ λ ]   [−c₀ ]
///
/// whose derivative is one more solution of it a direction: a few back-substitutions, no factorization.
/// One thread at a time.
class Sensitivity {
 public:
  /// Scales, analyses and factorizes the branch of `answer` once. The problem's arrays must outlive it.
  /// Errors: invalid_argument of field "solution.z" and such (other sizes, not finite); failed_precondition
  /// of field "solution" where it is not solved, or no isolated exact solution of its branch.
  [[nodiscard]] static Expected<Sensitivity> create(const Problem& problem, const Solution& answer);

  /// The same problem with new numbers, and an answer to it: scaling and analysis stay. Errors: as create(),
  /// and as PartSizes::check names them; this may then only be renewed or destroyed.
  [[nodiscard]] Expected<void> renew(const ProblemUpdate& update, const Solution& answer);

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

  /// Inequalities at zero whose multiplier is zero too, to 1e-6 scaled: a small change may go either way.
  [[nodiscard]] const std::vector<Index>& weak_inequalities() const;
  /// Pairs with both sides at zero that may leave by either side: not both multipliers are positive.
  [[nodiscard]] const std::vector<Index>& biactive_pairs() const;
  /// Whether there are none of both: derivatives hold in all directions, both ways.
  [[nodiscard]] bool is_smooth() const { return weak_inequalities().empty() && biactive_pairs().empty(); }

 private:
  struct State;
  explicit Sensitivity(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace marble
