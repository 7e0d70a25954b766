// The dual active set method in the space of the rows: min ½μᵀGμ + v₀ᵀμ over μ ≥ 0, free where a row is
// fixed.
//
// From multipliers of the right signs it adds the most violated row. If a multiplier reaches zero on the way,
// it removes that row. The objective only rises, so the method may stop as soon as it is high enough. A child
// of a node adds one more row. (Goldfarb and Idnani, "A numerically stable dual method for solving strictly
// convex quadratic programs", 1983; in the space of the rows as by Arnström, Bemporad and Axehill, "A dual
// active-set solver for embedded quadratic programming using recursive LDLᵀ updates", 2022.)
#pragma once

#include <cstdint>
#include <vector>

#include "global/cholesky.h"
#include "global/gram.h"

namespace marble {

class DualActiveSet {
 public:
  explicit DualActiveSet(GramColumns& gram);

  enum class RowKind : std::uint8_t { inequality, fixed, ignored };
  enum class End {
    optimal,     ///< no row is violated
    cutoff,      ///< the objective has risen by the requested amount
    infeasible,  ///< ray() seems to raise it without bound
    stopped,     ///< after too many steps, or interrupted
  };

  /// Resets to the multipliers and slacks of a point that is optimal for its center, to which all later moves
  /// refer.
  void start(ConstVectorRef multipliers, ConstVectorRef slacks);
  /// Replaces the center by another one for the current multipliers.
  [[nodiscard]] bool recenter(ConstVectorRef slacks);
  /// Holds these rows, whatever their multipliers are now; those with a wrong sign are removed.
  [[nodiscard]] bool hold(const std::vector<Index>& rows);
  /// Computes the multipliers of the held rows anew, after some are no longer fixed; those with a wrong sign
  /// are removed.
  [[nodiscard]] bool settle() {
    gain_ = 0.0;
    return solve_held();
  }
  void set_kind(Index row, RowKind kind) { kind_[row] = kind; }
  [[nodiscard]] RowKind kind(Index row) const { return kind_[row]; }

  /// From now on adds this many rows, each while it is violated, before the slacks of all rows are evaluated
  /// again; 1 adds the most violated of all rows each time.
  void consider(int candidates) { most_candidates_ = candidates; }
  [[nodiscard]] End run(double enough, int most_steps, const Interrupt& interrupt);
  /// Returns the objective, from that of the center's multipliers.
  [[nodiscard]] double objective() const { return -0.5 * (mu_ - mu_center_).dot(v_ + v_center_); }
  /// Returns the increase of the objective since start(), recenter() or hold().
  [[nodiscard]] double gain() const { return gain_; }
  [[nodiscard]] std::int64_t steps() const { return steps_; }
  /// After infeasible: the row that cannot be added.
  [[nodiscard]] Index blocked() const { return blocked_; }
  [[nodiscard]] const Vector& ray() const { return ray_; }

  [[nodiscard]] const Vector& multipliers() const { return mu_; }
  [[nodiscard]] const Vector& slacks() const { return v_; }  ///< 0 for held rows
  [[nodiscard]] const Vector& center_multipliers() const { return mu_center_; }
  [[nodiscard]] const Vector& center_slacks() const { return v_center_; }
  [[nodiscard]] const std::vector<Index>& held() const { return held_; }
  [[nodiscard]] bool is_held(Index row) const { return place_[row] >= 0; }
  /// Returns the increase of the objective in the first step towards `row` = 0.
  [[nodiscard]] double first_gain(Index row);
  /// Returns the decrease of the objective if `row` is no longer fixed and all others stay as they are.
  [[nodiscard]] double release_gain(Index row);

  /// The whole state, for save() and restore().
  struct State {
    std::vector<Index> held;
    std::vector<RowKind> kind;
    Vector mu, v, mu_center, v_center;
    Cholesky factor;
  };
  void save(State& state) const;
  void restore(const State& state);

 private:
  enum class Taken { held, enough, infeasible, stopped };
  [[nodiscard]] Taken take(Index row, double enough, int most_steps);
  [[nodiscard]] bool direction(Index row, double sign);
  [[nodiscard]] bool refactor();
  [[nodiscard]] bool solve_held();
  [[nodiscard]] bool evaluate_slacks();
  [[nodiscard]] double violation(Index row) const {
    if (is_held(row) || kind_[row] == RowKind::ignored) return 0.0;
    return kind_[row] == RowKind::fixed ? std::abs(v_[row]) : -v_[row];
  }
  [[nodiscard]] Index most_violated() const;
  void choose_candidates(Index first);
  [[nodiscard]] Index next_candidate();
  void append(Index row);
  void drop(Eigen::Index at);

  GramColumns& gram_;
  std::vector<RowKind> kind_;
  int most_candidates_ = 1;
  std::vector<Index> candidates_;
  std::vector<Index> held_, place_;  // rows in the factor's order; the position of each row in it, or −1
  Vector mu_, v_, mu_center_, v_center_;
  Cholesky factor_;
  Eigen::MatrixXd matrix_;
  // For the row that is being added: L⁻¹ of its column, the rates of the held multipliers, what remains of
  // its diagonal.
  Vector column_, rates_;
  double pivot_ = 0.0;
  bool dependent_ = false;
  double gain_ = 0.0;
  std::int64_t steps_ = 0;
  Index blocked_ = -1;
  Vector ray_;
};

}  // namespace marble
