// How an answer changes with its problem: derivatives of z and of the multipliers by every number of it. All
// of it is of the branch of the answer: the rows that are zero stay so, the others do not count. With a
// solve, by its last factor:
//
//   marble::SensitivityRequest request{.directions = {1, {.b = measured}}, .losses = {1, {.z = loss_by_z}}};
//   auto answer = solver.solve({.sensitivity = &request});
//   const marble::SensitivityAnswer& told = **answer->sensitivity;      // told.changes.z, told.gradients.b
//
// or later, of an answer from anywhere:
//
//   auto sensitivity = marble::Sensitivity::create(problem, answer);
//   auto change = sensitivity->along({.b = measured});            // forward: of the answer, by these numbers
//   auto gradient = sensitivity->gradient({.z = loss_by_z});      // adjoint: of a loss, by all numbers
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble {

struct SetupControls;

struct Solution;

/// Changes of an answer, by one unit of a direction.
struct AnswerChange {
  std::vector<double> z;                              ///< n
  std::vector<double> equality_multipliers;           ///< n_e
  std::vector<double> inequality_multipliers;         ///< n_i
  std::vector<double> complementarity_multipliers_L;  ///< n_c
  std::vector<double> complementarity_multipliers_R;  ///< n_c
  /// Whether the answer goes this way for small positive steps: the rows of weak_inequalities and
  /// biactive_pairs keep the right signs. Always true where there are none.
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

/// How m combinations E z of the variables follow a price μ on them: what solves that are coupled by such
/// rows tell each other. With the cost μᵀE z added, the branch's answer is z(μ) = z(0) − P Eᵀμ and
///
///   E z(μ) = r − S μ,   r = E z(0),   S = E P Eᵀ ⪰ 0,   P = [K⁻¹]_zz of the branch's system K
///
/// (P = Z (ZᵀQZ)⁻¹ Zᵀ for a basis Z of the directions that keep the branch's rows at zero). Borrows its
/// arrays.
struct RowsRequest {
  SparseMatrixView E;  ///< m × n, m ≥ 1
  /// n ≥ 0 numbers or empty: a diagonal that was added to Q, such as a proximal term's. Here Q is without it,
  /// in K and in z(0); it must then still be convex on the branch. Costs one more factorization.
  std::span<const double> proximal = {};
  std::span<const double> g = {};  ///< n or empty: the linear cost of z(0), in place of the problem's own
  bool columns = false;            ///< z(0) and P Eᵀ are wanted too
};

/// The answer to a RowsRequest.
struct RowResponse {
  std::vector<double> values;    ///< E z at the answer, m
  std::vector<double> free;      ///< r, m; the same where neither proximal nor g was given
  std::vector<double> response;  ///< S: its upper triangle by columns, S_ij at i + j (j + 1) / 2 for i ≤ j
  std::vector<double> z;         ///< z(0), n; empty unless columns are wanted
  std::vector<double> columns;   ///< P Eᵀ by columns, n m; empty unless they are wanted
};

/// Directions to go along: of each part of `numbers` that is there `count` times its size, one direction
/// after the other. What is absent is zero.
struct DirectionsRequest {
  Index count = 0;        ///< >= 0
  ProblemUpdate numbers;  ///< new numbers less the old ones
};

/// Losses: of each vector that is there `count` times its size, one loss after the other.
struct LossesRequest {
  Index count = 0;        ///< >= 0
  AnswerWeights weights;  ///< of each loss, by the vectors of the answer
};

/// What is asked of an answer's derivatives. Borrows its arrays.
struct SensitivityRequest {
  std::optional<RowsRequest> rows = {};  ///< the response of rows
  DirectionsRequest directions = {};     ///< forward
  LossesRequest losses = {};             ///< adjoint
};

/// The same with its arrays.
struct OwnedSensitivityRequest {
  Index directions = 0;                               ///< how many
  OwnedProblem numbers;                               ///< of the directions; of its matrices the values
  Index losses = 0;                                   ///< how many
  std::vector<double> z;                              ///< of the losses, as AnswerWeights has them
  std::vector<double> equality_multipliers;           ///< the same
  std::vector<double> inequality_multipliers;         ///< the same
  std::vector<double> complementarity_multipliers_L;  ///< the same
  std::vector<double> complementarity_multipliers_R;  ///< the same
  SparseMatrix E;                                     ///< as RowsRequest has it; no rows: none are asked for
  std::vector<double> proximal;                       ///< the same
  std::vector<double> g;                              ///< the same
  bool columns = false;                               ///< the same

  /// Borrows its arrays.
  [[nodiscard]] SensitivityRequest view() const;
};

/// Whether they are of a problem of these sizes, or absent. Errors: invalid_argument of the fields "z" and
/// such.
[[nodiscard]] Expected<void> check(const AnswerWeights& weights, const PartSizes& sizes);
/// Whether it can be asked of a problem of these sizes. Errors: invalid_argument of the fields
/// "rows.E.values", "rows.proximal", "directions.count", "directions.A.values", "losses.z" and such.
[[nodiscard]] Expected<void> check(const SensitivityRequest& request, const PartSizes& sizes);
/// Memory of the answer to it, with what is needed to find it beside the solver, in bytes.
[[nodiscard]] double bytes_of(const SensitivityRequest& request, const PartSizes& sizes);

/// Changes of an answer along directions, as AnswerChange has them, one after the other.
struct AnswerChanges {
  std::vector<double> z;                              ///< count n
  std::vector<double> equality_multipliers;           ///< count n_e
  std::vector<double> inequality_multipliers;         ///< count n_i
  std::vector<double> complementarity_multipliers_L;  ///< count n_c
  std::vector<double> complementarity_multipliers_R;  ///< count n_c
  std::vector<std::uint8_t> holds;                    ///< count: 1 where AnswerChange::holds
  /// Directions without a change, whose numbers are NaN: the branch is flat along them, or its rows depend on
  /// each other and contradict.
  std::vector<Index> missing;
};

/// Gradients of losses, as ProblemGradient has them, one after the other.
struct ProblemGradients {
  std::vector<double> g;  ///< count n
  std::vector<double> b;  ///< count n_e
  std::vector<double> d;  ///< count n_i
  std::vector<double> l;  ///< count n_c
  std::vector<double> r;  ///< count n_c
  std::vector<double> Q;  ///< count times one per stored entry
  std::vector<double> A;  ///< count times one per stored entry
  std::vector<double> C;  ///< count times one per stored entry
  std::vector<double> L;  ///< count times one per stored entry
  std::vector<double> R;  ///< count times one per stored entry
  /// Losses without a gradient, whose numbers are NaN: the multipliers they weigh are not unique, or the
  /// branch is flat.
  std::vector<Index> missing;
};

/// The derivatives that were asked for.
struct SensitivityAnswer {
  /// Inequalities at zero whose multiplier is zero too, to 1e-6 scaled: a small change may go either way.
  std::vector<Index> weak_inequalities;
  /// Pairs with both sides at zero that may leave by either side: not both multipliers are positive.
  std::vector<Index> biactive_pairs;
  /// If they were asked for; failed_precondition where the branch is flat along one, or not convex without
  /// the proximal diagonal.
  std::optional<Expected<RowResponse>> rows;
  AnswerChanges changes;            ///< one per direction
  ProblemGradients gradients;       ///< one per loss
  std::int32_t factorizations = 0;  ///< 0 where the solve's last factor was the branch's
  /// With one factor, two or three for each row, direction and loss; up to eight of a kind share one's time.
  std::int32_t back_substitutions = 0;

  /// Whether derivatives hold in all directions, both ways. Else they are the branch's, one of several, and
  /// AnswerChange::holds tells of which directions they are true.
  [[nodiscard]] bool is_smooth() const { return weak_inequalities.empty() && biactive_pairs.empty(); }
};

/// The branch of an answer and its factor. On the branch the answer solves
///
///   [ Q   Aᵀ  J₀ᵀ ] [ z ]   [ −g ]
///   [ A            ] [ y ] = [ −b ]
///   [ J₀           ] [ λ ]   [−c₀ ]
///
/// with J₀ the rows of [C; L; R] that are zero, c₀ their offsets and λ = −(ν, ξ, η),
/// whose derivative is one more solution of it a direction: two or three back-substitutions, no
/// factorization. SolveControls::sensitivity asks the same of a solver, which has the factor already. Where
/// there are many, answer() takes a third of the time. One thread at a time.
class Sensitivity {
 public:
  /// Scales, analyses and factorizes the branch of `answer` once. Keeps nothing of the problem's arrays.
  /// Errors: invalid_argument of field "solution.z" and such (other sizes, not finite); failed_precondition
  /// of field "solution" where it is not solved, or no isolated exact solution of its branch.
  [[nodiscard]] static Expected<Sensitivity> create(const Problem& problem, const Solution& answer);
  /// Within limits: what needs more memory is refused with resource_exhausted, field "problem", before it is
  /// allocated; the stop and the moment end this and all that is asked later, with failed_precondition.
  [[nodiscard]] static Expected<Sensitivity> create(const Problem& problem, const Solution& answer,
                                                    const SetupControls& controls);

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

  /// How rows E z follow a price on them. Errors: invalid_argument, fields "rows.E.values" and such;
  /// failed_precondition of field "rows" where the branch is flat along one, or not convex without proximal.
  [[nodiscard]] Expected<RowResponse> rows(const RowsRequest& request);

  /// All of a request, up to eight directions, losses and rows at once. Errors: as check() of the request and
  /// rows(); what has no derivative is `missing` or an error in the answer.
  [[nodiscard]] Expected<SensitivityAnswer> answer(const SensitivityRequest& request);

  /// As SensitivityAnswer has them.
  [[nodiscard]] const std::vector<Index>& weak_inequalities() const;
  /// As SensitivityAnswer has them.
  [[nodiscard]] const std::vector<Index>& biactive_pairs() const;
  /// What it takes, in bytes, by the estimate of create().
  [[nodiscard]] std::int64_t memory_bytes() const;
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
