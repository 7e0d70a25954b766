// The answer of a solve, solved or not.
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

/// Why a solve ended. Every status comes with the best iterate and its violations. Listed, with what they
/// mean and what to try, in contract.def.
enum class Status {
#define MARBLE_STATUS(name, ...) name,
#include "marble/contract.def"
};

/// As in logs and files: "solved_reduced".
[[nodiscard]] const char* to_string(Status status);
/// What to try after a solve that ended so, in a sentence or two; empty of solved.
[[nodiscard]] const char* advice(Status status);
/// Whether the tolerances, or the reduced ones, are met.
[[nodiscard]] constexpr bool is_solved(Status status) {
  return status == Status::solved || status == Status::solved_reduced;
}

/// Kinds of stationary points, by the multipliers ξ, η of pairs with s = t = 0; each includes those before
/// it.
enum class Stationarity {
  unknown,       ///< the point is not solved
  weak,          ///< W: stationary with both sides as equalities, ξ and η of any sign
  clarke,        ///< C: ξ η ≥ 0
  mordukhovich,  ///< M: ξ, η > 0 or ξ η = 0
  strong,        ///< S: ξ, η ≥ 0; then no direction of descent is left
};

/// "unknown", "weak", "clarke", "mordukhovich", "strong".
[[nodiscard]] const char* to_string(Stationarity stationarity);

/// What the curvature of Q says of a stationary point. With linear constraints one is a local minimum exactly
/// if vᵀQv ≥ 0 for all v of its critical cone: Av = 0, rows with a multiplier stay at zero, other active rows
/// may grow, of pairs with s = t = 0 one side at a time (Nocedal and Wright, "Numerical Optimization", ch.
/// 12).
enum class SecondOrder {
  unknown,    ///< not solved, or not looked at
  saddle,     ///< vᵀQv < 0 for a v of the critical cone: a saddle point or a maximum, no local minimum
  necessary,  ///< vᵀQv ≥ 0 for all v that keep every active row at zero; the rest of the cone, or whether z
              ///< is B-stationary, was not decided
  minimum,  ///< vᵀQv ≥ 0 on the whole cone of a B-stationary point: a local minimum
  convex,   ///< the same, and Q is known to be convex: z is the optimum of each branch that it belongs to,
           ///< without pairs the optimum. Known of a diagonally dominant Q, and where a solve had to factor Q
};

/// "unknown", "saddle", "necessary", "minimum", "convex".
[[nodiscard]] const char* to_string(SecondOrder second_order);

/// Where the point of an answer comes from.
enum class PointOrigin {
  solve,     ///< this solve
  previous,  ///< the solution before it: a sequence's solve that ended early had no better feasible point
};

/// "solve", "previous".
[[nodiscard]] const char* to_string(PointOrigin origin);

/// Seconds spent, by part.
struct Times {
  double setup_s = 0.0;          ///< scaling, ordering, symbolic analysis, allocation
  double factorization_s = 0.0;  ///< numeric factorizations
  double line_search_s = 0.0;    ///< trial points
  double solve_s = 0.0;          ///< the whole solve without set-up
  double polish_s = 0.0;  ///< exact solutions and the search for better branches, but for factorizations
  double tree_s = 0.0;    ///< branch and bound over the pairs with the searches in it, likewise

  /// Part by part.
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

/// All vectors in the user's units, with Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη = 0, ν ≥ 0 at a solution.
struct Solution {
  Status status = Status::numerical_failure;          ///< why the solve ended
  std::string detail;                                 ///< one sentence: the numbers that justify the status
  PointOrigin origin = PointOrigin::solve;            ///< where z comes from
  std::vector<double> z;                              ///< n
  std::vector<double> equality_multipliers;           ///< y, n_e, free sign
  std::vector<double> inequality_multipliers;         ///< ν ≥ 0, n_i
  std::vector<double> complementarity_multipliers_L;  ///< ξ, n_c; sign free where s = 0 < t, 0 where s > 0
  std::vector<double> complementarity_multipliers_R;  ///< η, n_c; sign free where t = 0 < s, 0 where t > 0
  std::vector<double> certificate;  ///< for infeasible: (y, ν, ξ, η) stacked, empty where each branch was
                                    ///< refuted by itself; for unbounded: direction (n); else empty
  Stationarity stationarity = Stationarity::unknown;  ///< what z is proved to be
  /// B-stationary: no feasible direction of descent. True where the point is strongly stationary, solves each
  /// of the few branches it belongs to, or is proved to be the optimum; absent where that was not decided.
  std::optional<bool> b_stationary;
  /// Whether z is a local minimum, by the curvature of Q (scaled, to 1e-7).
  SecondOrder second_order = SecondOrder::unknown;
  double objective = 0.0;  ///< ½ zᵀQz + gᵀz + c₀
  /// Option global: true of an answer within gap_tolerance of the bound, and of a tree that ended infeasible.
  /// Also true, without it, of a certificate, and of a small problem whose tree came to its end within
  /// small_budget. Where the answer of option global is not proved, `detail` says why.
  bool proved = false;
  /// No feasible point has an objective below this, rounding paid for; where rows leave a variable unbounded,
  /// none with |z|∞ up to the radius in `detail`. −∞ where none is known, so of what neither option global
  /// nor small_budget has bounded; +∞ of a problem that is proved infeasible. See also marble::Proof.
  double bound = -std::numeric_limits<double>::infinity();
  /// (objective − bound) / max(1, |objective|), ≥ 0; +∞ without a feasible point or a bound.
  double gap = std::numeric_limits<double>::infinity();
  std::int64_t nodes = 0;       ///< of the tree of option global or small_budget that were bounded
  std::int64_t open_nodes = 0;  ///< of them left open at the end: 0 of a tree that was searched to its end
  /// Of a session's last tree, that this one began with instead of the root: bounded anew by the multipliers
  /// they were closed with, not solved again. `detail` says how many of them are closed still.
  std::int64_t warm_nodes = 0;
  /// What a cold start last reached on the way to this answer: the objective itself, or, of a chain of warm
  /// starts, that of its first. A warm start that ends clearly above it starts cold too; with infinity, none.
  double cold_objective = 0.0;
  Violations violations;  ///< of z, user units
  /// max |Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη| or max |ν (Cz + d)|, whichever is larger, in the user's units
  double kkt_residual = 0.0;
  std::int32_t iterations = 0;  ///< Newton steps
  /// All of them, rejected ones included. With option global each helper of a TaskRunner makes one of its own
  /// for some problems; nothing else depends on who helps.
  std::int32_t factorizations = 0;
  Times times;  ///< where the time went
  /// The derivatives that SolveControls::sensitivity asked for, or why there are none: failed_precondition of
  /// field "solution" where it is not solved, or no isolated exact solution of its branch. Absent where none
  /// were asked for.
  std::optional<Expected<SensitivityAnswer>> sensitivity;
  /// Of option explain: which parts make the problem infeasible. Absent where it is not proved to be.
  std::optional<Conflict> conflict;
};

}  // namespace marble
