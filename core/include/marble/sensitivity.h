// Derivatives of a solution, of its z and its multipliers, with respect to every number of the problem. They
// are those of the solution's branch: rows that are zero stay zero, and the other rows have no effect.
// Together with a solve, by its last factor:
//
//   marble::SensitivityRequest request{.directions = {1, {.b = measured}}, .losses = {1, {.z = loss_by_z}}};
//   auto answer = solver.solve({.sensitivity = &request});
//   const marble::SensitivityAnswer& found = **answer->sensitivity;    // found.changes.z, found.gradients.b
//
// or later, for a solution from any source:
//
//   auto sensitivity = marble::Sensitivity::create(problem, answer);
//   auto change = sensitivity->along({.b = measured});        // forward: of the solution, by these numbers
//   auto gradient = sensitivity->gradient({.z = loss_by_z});  // adjoint: of a loss, by all numbers
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

/// The derivative of a solution along a direction (forward mode).
struct AnswerChange {
  std::vector<double> z;                              ///< n
  std::vector<double> equality_multipliers;           ///< n_e
  std::vector<double> inequality_multipliers;         ///< n_i
  std::vector<double> complementarity_multipliers_L;  ///< n_c
  std::vector<double> complementarity_multipliers_R;  ///< n_c
  /// True if the solution moves this way for small positive steps: the rows of weak_inequalities and
  /// biactive_pairs keep the right signs. Always true if there are none.
  bool active_set_constant = true;
};

/// Derivatives of a loss by the vectors of a solution. Absent ones are zero.
struct AnswerWeights {
  std::span<const double> z = {};                              ///< n
  std::span<const double> equality_multipliers = {};           ///< n_e
  std::span<const double> inequality_multipliers = {};         ///< n_i
  std::span<const double> complementarity_multipliers_L = {};  ///< n_c
  std::span<const double> complementarity_multipliers_R = {};  ///< n_c
};

/// Derivatives of a loss by the numbers of a problem (adjoint mode). Those of Q belong to its upper entries,
/// which stand for their mirror images too; the lower entries of a full Q, which updates ignore, have 0.
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

/// Requests how m combinations E z of the variables respond to multipliers (coupling_multipliers) μ on them:
/// the information that solves coupled by such rows exchange. With the cost μᵀE z added, the branch's
/// solution is z(μ) = z(0) − P Eᵀμ and
///
///   E z(μ) = r − S μ,   r = E z(0),   S = E P Eᵀ ⪰ 0,   P = [K⁻¹]_zz of the branch's system K
///
/// (P = Z (ZᵀQZ)⁻¹ Zᵀ for a basis Z of the directions that keep the branch's rows at zero). Borrows its
/// arrays.
struct RowsRequest {
  SparseMatrixView E;  ///< m × n, m ≥ 1 and at most n plus the number of entries
  /// n numbers ≥ 0 or empty: a diagonal that was added to Q, such as that of a proximal term. K and z(0) use
  /// Q without it, which must still be convex on the branch. Costs one more factorization.
  std::span<const double> proximal = {};
  std::span<const double> g = {};  ///< n or empty: the linear cost for z(0), instead of the problem's own
  bool columns = false;            ///< also return z(0) and P Eᵀ
};

/// The response to a RowsRequest.
struct RowResponse {
  std::vector<double> values;    ///< E z at the solution, m
  std::vector<double> free;      ///< r, m; equal to `values` if neither proximal nor g was given
  std::vector<double> response;  ///< S: its upper triangle by columns, S_ij at i + j (j + 1) / 2 for i ≤ j
  std::vector<double> z;         ///< z(0), n; empty unless columns are requested
  std::vector<double> columns;   ///< P Eᵀ by columns, n m; empty unless requested
};

/// Directions for forward mode. Each part of `numbers` that is present has `count` times its size, one
/// direction after the other. Absent parts are zero.
struct DirectionsRequest {
  Index count = 0;        ///< >= 0; at most 1 without numbers
  ProblemUpdate numbers;  ///< new numbers minus the old ones
};

/// Losses for adjoint mode. Each vector that is present has `count` times its size, one loss after the other.
struct LossesRequest {
  Index count = 0;        ///< >= 0; at most 1 without weights
  AnswerWeights weights;  ///< derivatives of each loss by the vectors of the solution
};

/// A request for derivatives of a solution. Borrows its arrays.
struct SensitivityRequest {
  std::optional<RowsRequest> rows = {};  ///< the response of rows to multipliers
  DirectionsRequest directions = {};     ///< forward mode
  LossesRequest losses = {};             ///< adjoint mode
};

/// The same, but owns its arrays.
struct OwnedSensitivityRequest {
  Index directions = 0;                               ///< how many
  OwnedProblem numbers;                               ///< of the directions; its matrices contain the values
  Index losses = 0;                                   ///< how many
  std::vector<double> z;                              ///< of the losses, as in AnswerWeights
  std::vector<double> equality_multipliers;           ///< the same
  std::vector<double> inequality_multipliers;         ///< the same
  std::vector<double> complementarity_multipliers_L;  ///< the same
  std::vector<double> complementarity_multipliers_R;  ///< the same
  SparseMatrix E;                                     ///< as in RowsRequest; without rows, none are requested
  std::vector<double> proximal;                       ///< the same
  std::vector<double> g;                              ///< the same
  bool columns = false;                               ///< the same

  /// Returns a view of the arrays.
  [[nodiscard]] SensitivityRequest view() const;
};

/// Checks that the weights have a problem's sizes or are absent. Errors: invalid_argument of the fields "z",
/// ….
[[nodiscard]] Expected<void> check(const AnswerWeights& weights, const PartSizes& sizes);
/// Checks that the request fits a problem of these sizes. Errors: invalid_argument of the fields
/// "rows.E.values", "rows.proximal", "directions.count", "directions.A.values", "losses.z", ….
[[nodiscard]] Expected<void> check(const SensitivityRequest& request, const PartSizes& sizes);
/// Returns the memory of the response and of the work for it, without the solver, in bytes.
[[nodiscard]] double bytes_of(const SensitivityRequest& request, const PartSizes& sizes);

/// Derivatives of a solution along directions, as in AnswerChange, one after the other.
struct AnswerChanges {
  std::vector<double> z;                              ///< count n
  std::vector<double> equality_multipliers;           ///< count n_e
  std::vector<double> inequality_multipliers;         ///< count n_i
  std::vector<double> complementarity_multipliers_L;  ///< count n_c
  std::vector<double> complementarity_multipliers_R;  ///< count n_c
  std::vector<std::uint8_t>
      active_set_constant;  ///< count: 1 where AnswerChange::active_set_constant is true
  /// Directions without a derivative; their numbers are NaN. The branch is flat along them, or its rows
  /// depend on each other and contradict.
  std::vector<Index> undefined;
};

/// Gradients of losses, as in ProblemGradient, one after the other.
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
  /// Losses without a gradient; their numbers are NaN. The multipliers that they weight are not unique, or
  /// the branch is flat.
  std::vector<Index> undefined;
};

/// The requested derivatives.
struct SensitivityAnswer {
  /// Inequalities at zero whose multiplier is also zero, to 1e-6 scaled: a small change may go either way.
  std::vector<Index> weak_inequalities;
  /// Pairs with both sides at zero, either of which may become positive: not both multipliers are positive.
  std::vector<Index> biactive_pairs;
  /// Present if requested; failed_precondition if the branch is flat along a row, or not convex without the
  /// proximal diagonal.
  std::optional<Expected<RowResponse>> rows;
  AnswerChanges changes;            ///< one per direction
  ProblemGradients gradients;       ///< one per loss
  std::int32_t factorizations = 0;  ///< 0 if the solve's last factor was that of the branch
  /// With one factor, two or three for each row, direction and loss; up to eight of a kind take the time of
  /// one.
  std::int32_t back_substitutions = 0;

  /// True if the derivatives hold in all directions, both ways. Otherwise they are those of one of several
  /// branches, and AnswerChange::active_set_constant says for which directions they hold.
  [[nodiscard]] bool is_smooth() const { return weak_inequalities.empty() && biactive_pairs.empty(); }
};

/// The branch of a solution and its factor. On the branch, the solution satisfies
///
///   [ Q   Aᵀ  J₀ᵀ ] [ z ]   [ −g ]
///   [ A            ] [ y ] = [ −b ]
///   [ J₀           ] [ λ ]   [−c₀ ]
///
/// with J₀ the rows of [C; L; R] that are zero, c₀ their offsets and λ = −(ν, ξ, η). Each derivative takes
/// one more solution of this system: two or three back-substitutions, no factorization.
/// SolveControls::sensitivity requests the same from a solver, which already has the factor. For many
/// derivatives, answer() takes a third of the time. One thread at a time.
class Sensitivity {
 public:
  /// Scales, analyses and factorizes the branch of `answer` once. Keeps none of the problem's arrays. Errors:
  /// invalid_argument of field "solution.z", … (other sizes, not finite); failed_precondition of field
  /// "solution" if it is not solved, or not an isolated exact solution of its branch.
  [[nodiscard]] static Expected<Sensitivity> create(const Problem& problem, const Solution& answer);
  /// The same with limits. A problem that needs more memory is refused with resource_exhausted, field
  /// "problem", before allocation. The stop token and the end time end this call and all later requests, with
  /// failed_precondition; the pause must outlive the object.
  [[nodiscard]] static Expected<Sensitivity> create(const Problem& problem, const Solution& answer,
                                                    const SetupControls& controls);

  /// Sets new numbers of the same problem and a solution of it; scaling and analysis are kept. Errors: as
  /// create() and PartSizes::check; the object may then only be renewed or destroyed.
  [[nodiscard]] Expected<void> renew(const ProblemUpdate& update, const Solution& answer);

  /// A moved-from object may only be assigned to or destroyed.
  Sensitivity(Sensitivity&&) noexcept;
  /// As the move constructor.
  Sensitivity& operator=(Sensitivity&&) noexcept;
  ~Sensitivity();

  /// Returns the derivative along a direction: new numbers minus the old ones. Absent parts do not change.
  /// Errors: invalid_argument as in PartSizes::check; failed_precondition of field "direction" if the
  /// branch's rows depend on each other and contradict along it, or leave a flat direction.
  [[nodiscard]] Expected<AnswerChange> along(const ProblemUpdate& direction);

  /// Returns the gradient of a loss by all numbers at once, for one solution of the system. If not
  /// is_smooth(), it is that of one of several branches. Errors: as along(), fields "weights.z", ….
  [[nodiscard]] Expected<ProblemGradient> gradient(const AnswerWeights& weights);

  /// Returns how rows E z respond to multipliers on them. Errors: invalid_argument, fields "rows.E.values",
  /// …; failed_precondition of field "rows" if the branch is flat along one, or not convex without proximal.
  [[nodiscard]] Expected<RowResponse> rows(const RowsRequest& request);

  /// Answers a whole request, up to eight directions, losses and rows at once. Errors: as check() of the
  /// request and rows(). Undefined derivatives are listed in `undefined` or are errors in the result.
  [[nodiscard]] Expected<SensitivityAnswer> answer(const SensitivityRequest& request);

  /// As in SensitivityAnswer.
  [[nodiscard]] const std::vector<Index>& weak_inequalities() const;
  /// As in SensitivityAnswer.
  [[nodiscard]] const std::vector<Index>& biactive_pairs() const;
  /// Returns the memory in use, in bytes, as estimated by create().
  [[nodiscard]] std::int64_t memory_bytes() const;
  /// Returns the factorizations of all requests so far.
  [[nodiscard]] std::int32_t factorizations() const;
  /// Returns the back-substitutions of all requests so far.
  [[nodiscard]] std::int32_t back_substitutions() const;
  /// True if both lists are empty: derivatives hold in all directions, both ways.
  [[nodiscard]] bool is_smooth() const { return weak_inequalities().empty() && biactive_pairs().empty(); }

 private:
  struct State;
  explicit Sensitivity(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace marble
