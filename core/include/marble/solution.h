// The solution that a solve returns, with its status.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "marble/progress.h"
#include "marble/report/conflict.h"
#include "marble/sensitivity.h"

namespace marble {

/// Why a solve ended. Every status comes with the best iterate and its violations. contract.def lists all
/// statuses with their meanings and advice.
enum class Status {
#define MARBLE_STATUS(name, ...) name,
#include "marble/contract.def"
};

/// Returns the name used in logs and files: "almost_solved".
[[nodiscard]] const char* to_string(Status status);
/// Returns one or two sentences on what to try after this status; empty for solved.
[[nodiscard]] const char* advice(Status status);
/// True if the tolerances, or the reduced ones, are met.
[[nodiscard]] constexpr bool is_solved(Status status) {
  return status == Status::solved || status == Status::almost_solved;
}

/// Kinds of stationary points, by the multipliers ξ, η of pairs with s = t = 0; each kind includes the kinds
/// before it.
enum class Stationarity {
  unknown,       ///< the point is not solved
  weak,          ///< W: stationary with both sides as equalities; ξ and η have any sign
  clarke,        ///< C: ξ η ≥ 0
  mordukhovich,  ///< M: ξ, η > 0 or ξ η = 0
  strong,        ///< S: ξ, η ≥ 0; no direction of descent is left
};

/// "unknown", "weak", "clarke", "mordukhovich", "strong".
[[nodiscard]] const char* to_string(Stationarity stationarity);

/// What the curvature of Q implies for a stationary point. With linear constraints, such a point is a local
/// minimum exactly if vᵀQv ≥ 0 for all v of its critical cone: Av = 0, rows with a multiplier stay at zero,
/// other active rows may grow, and of pairs with s = t = 0 one side at a time (Nocedal and Wright, "Numerical
/// Optimization", ch. 12).
enum class SecondOrder {
  unknown,    ///< not solved, or not checked
  saddle,     ///< vᵀQv < 0 for a v of the critical cone: a saddle point or a maximum, not a local minimum
  necessary,  ///< vᵀQv ≥ 0 for all v that keep every active row at zero; the rest of the cone, or whether z
              ///< is B-stationary, was not decided
  minimum,  ///< vᵀQv ≥ 0 on the whole cone of a B-stationary point: a local minimum
  convex,   ///< as minimum, and Q is known to be convex: z is the optimum of each branch that it belongs to;
            ///< without pairs it is the optimum. Convexity is known if Q is diagonally dominant, and where a
            ///< solve had to factor Q
};

/// "unknown", "saddle", "necessary", "minimum", "convex".
[[nodiscard]] const char* to_string(SecondOrder second_order);

/// Where the point of a solution comes from.
enum class PointOrigin {
  solve,     ///< this solve
  previous,  ///< the previous solution: a solve of a sequence ended early without a better feasible point
};

/// "solve", "previous".
[[nodiscard]] const char* to_string(PointOrigin origin);

/// Seconds spent in each part.
struct Times {
  double setup_s = 0.0;          ///< scaling, ordering, symbolic analysis, allocation
  double factorization_s = 0.0;  ///< numeric factorizations
  double line_search_s = 0.0;    ///< trial points
  double solve_s = 0.0;          ///< the whole solve without set-up
  double polish_s = 0.0;  ///< exact solutions and the search for better branches, without factorizations
  double tree_s = 0.0;    ///< branch and bound over the pairs with its searches, without factorizations

  /// Adds each part.
  Times& operator+=(const Times& other) {
    setup_s += other.setup_s;
    factorization_s += other.factorization_s;
    line_search_s += other.line_search_s;
    solve_s += other.solve_s;
    polish_s += other.polish_s;
    tree_s += other.tree_s;
    return *this;
  }
};

/// The result of a solve. All vectors are in the user's units. At a solution, Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη
/// = 0 and ν ≥ 0.
// After a change run proto/generate: it makes solution.def, from which conversions and clients follow.
struct Solution {
  Status status = Status::numerical_failure;          ///< why the solve ended
  std::string detail;                                 ///< one sentence: the numbers that justify the status
  PointOrigin origin = PointOrigin::solve;            ///< where z comes from
  std::vector<double> z;                              ///< n
  std::vector<double> equality_multipliers;           ///< y, n_e, free sign
  std::vector<double> inequality_multipliers;         ///< ν ≥ 0, n_i
  std::vector<double> complementarity_multipliers_L;  ///< ξ, n_c; free sign where s = 0 < t, 0 where s > 0
  std::vector<double> complementarity_multipliers_R;  ///< η, n_c; free sign where t = 0 < s, 0 where t > 0
  std::vector<double> certificate;  ///< for infeasible: (y, ν, ξ, η) stacked, empty if each branch was
                                    ///< refuted separately; for unbounded: direction (n); else empty
  Stationarity stationarity = Stationarity::unknown;  ///< the kind of stationarity proved for z
  /// B-stationary: no feasible direction of descent. True if the point is strongly stationary, solves each of
  /// the few branches that it belongs to, or is proved to be optimal; absent if that was not decided.
  std::optional<bool> b_stationary;
  /// Whether z is a local minimum, judged by the curvature of Q (scaled, to 1e-7).
  SecondOrder second_order = SecondOrder::unknown;
  double objective = 0.0;  ///< ½ zᵀQz + gᵀz + c₀
  /// With option global_search: true if the solution is within relative_gap_tolerance of the bound, or if the
  /// tree proved infeasibility. Without it: true for a certificate, and for a small problem whose tree was
  /// completed within max_small_problem_nodes. If the solution of option global_search is not proved,
  /// `detail` says why.
  bool proved = false;
  /// Lower bound: no feasible point has an objective below it, with an allowance for rounding; where rows
  /// leave a variable unbounded, this holds for |z|∞ up to the radius in `detail`. −∞ if no bound is known,
  /// so wherever neither option global_search nor max_small_problem_nodes computed one; +∞ for a problem that
  /// is proved infeasible. See also marble::Proof.
  double bound = -std::numeric_limits<double>::infinity();
  /// (objective − bound) / max(1, |objective|), ≥ 0; +∞ without a feasible point or a bound.
  double gap = std::numeric_limits<double>::infinity();
  std::int64_t nodes = 0;  ///< bounded nodes of the tree of option global_search or max_small_problem_nodes
  std::int64_t open_nodes = 0;  ///< nodes left open at the end: 0 if the tree was searched completely
  /// Leaves of a session's last tree with which this tree began instead of the root. They were bounded again
  /// by the multipliers that closed them, without a new solve. `detail` says how many of them stayed closed.
  std::int64_t reused_nodes = 0;
  /// The objective after the last cold start or search for better branches on the way to this solution: the
  /// objective itself or, in a chain of warm starts, that of an earlier solve. A warm start that ends clearly
  /// above it is followed by such a search or by a cold start; with infinity, never.
  double reference_objective = 0.0;
  Violations violations;  ///< of z, user units
  /// max |Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη| or max |ν (Cz + d)|, whichever is larger, in the user's units
  double kkt_residual = 0.0;
  std::int32_t iterations = 0;  ///< Newton steps
  /// All factorizations, including rejected ones. With option global_search, each helper of a TaskRunner
  /// makes one of its own for some problems; nothing else depends on the helpers.
  std::int32_t factorizations = 0;
  Times times;  ///< time spent in each part
  /// The derivatives that SolveControls::sensitivity requested, or why there are none: failed_precondition of
  /// field "solution" if it is not solved, or not an isolated exact solution of its branch. Absent if none
  /// were requested.
  std::optional<Expected<SensitivityAnswer>> sensitivity;
  /// With option explain: the parts that make the problem infeasible. Absent if infeasibility is not proved.
  std::optional<Conflict> conflict;
};

}  // namespace marble
