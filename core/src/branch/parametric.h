// Parametric active set: how the optimum of an elastic branch moves while rows are released or driven to
// zero.
//
// A row is an inequality or a side of a pair: C, then L, then R. The start is the optimum that
// ElasticRelaxation found. The slack of a released row grows until its multiplier is 0; the slack of a driven
// row falls to 0 and stays there. Between the points at which other rows become active or inactive, all
// values are linear and the objective is quadratic. Rows that differ from the factorized working set are
// bordered: the responses of all rows to unit forces (or slacks) in them are computed once per factorization
// and coupled by a small dense system. A candidate of a local search thus costs a few back-substitutions
// instead of factorizations, and is exact. (The homotopy of Best, "An algorithm for the solution of the
// parametric quadratic programming problem", 1982.)
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "branch/bordered_inverse.h"
#include "branch/elastic_relaxation.h"

namespace marble {

class Parametric {
 public:
  struct Move {
    Index row;
    bool drive;  ///< drive to zero and fix there; otherwise release
  };

  Parametric(const ScaledProblem& problem, Kkt& kkt);
  /// Returns the memory of the stored responses for a problem with this many pairs, and rows as above.
  [[nodiscard]] static double response_bytes(Index pairs, double rows);

  /// Sets the optimum at which the following moves start; `kkt` must hold its factor.
  void start(const ElasticRelaxation& optimum);

  /// Remembers the values of a point that solves its branch for similar numbers.
  void begin_change(const BranchPoint& point);
  /// `point` now solves its rows for the problem's numbers, perhaps with wrong signs; `kkt` holds its factor.
  /// Moves its held rows to those that the optimum has as the numbers change from the remembered ones. If too
  /// many rows change, it stops on the way, where the next call continues.
  void follow_change(BranchPoint& point);

  /// `point` solves its branch exactly, and `kkt` holds its factor. Switches each pair that pulls, with no
  /// other pair complementary, and returns whether an optimum of these is lower by more than `gain`, or may
  /// be. If none is and Q is convex, no branch is.
  [[nodiscard]] bool may_gain(const BranchPoint& point, double gain);

  /// Rows of pair i at the start: the side that its branch fixes, and the other one.
  [[nodiscard]] Index fixed_row(Index pair) const { return start_.fixed_row(pair); }
  [[nodiscard]] Index free_row(Index pair) const { return start_.free_row(pair); }
  /// At the start: the multiplier ν of an active row (negative for a fixed side with a wrong-sign
  /// multiplier), and the slack of an inactive row (0 if active).
  [[nodiscard]] double multiplier(Index row) const { return start_.held[row] ? start_value_[row] : 0.0; }
  [[nodiscard]] double slack(Index row) const { return start_.held[row] ? 0.0 : start_value_[row]; }

  /// Makes the moves one after the other. Returns the elastic objective at their end, or nothing as soon as
  /// it cannot end below `cutoff`, or if too many rows change. While moves that release are still to come,
  /// the objective may exceed the cutoff by up to `climb`.
  [[nodiscard]] std::optional<double> follow(std::span<const Move> moves, double cutoff, double climb);
  /// Reads the working set at the end of the last successful follow(), for the switched pairs of `set`.
  void read_active_rows(WorkingSet& set) const;
  /// Adds the rows that are active at the end of the last successful follow() but not at its start, or vice
  /// versa.
  void read_changed_rows(std::vector<Index>& rows) const;

  /// Computes how fast multipliers change at the start while `drive` falls and `release` is free. Returns
  /// false if `drive` is already active.
  [[nodiscard]] bool probe(Index release, Index drive);
  [[nodiscard]] double probed_rate(Index row) const { return value_rate_[row]; }
  [[nodiscard]] double probed_stiffness() const { return std::abs(changed_.back().rate); }  ///< of `drive`

 private:
  struct Changed {
    Index row;
    double value;  // its multiplier if it was inactive at the start, its slack if it was active
    double rate = 0.0;
  };
  // State of a row during the moves: initially that at the start, then changed by the moves and events.
  struct RowState {
    bool fixed = false;    // it stays at zero whatever its multiplier
    bool changed = false;  // it is active but was not at the start, or vice versa
  };
  void start(const BranchPoint& point);
  void read_values(const BranchPoint& point, Vector& values) const;
  void reset();
  [[nodiscard]] const double* response(Index row);
  [[nodiscard]] const double* kept_response(Index row) const {
    return responses_.get() + static_cast<std::size_t>(response_of_row_[row]) * rows_;
  }
  [[nodiscard]] bool direction(Index prescribed, double prescribed_rate, Index driven);
  [[nodiscard]] bool direction(const double* fixed_part, double fixed_rate, Index driven);
  [[nodiscard]] Index first_event(double& length, Index driven) const;
  void advance(double length);
  void toggle(Index row);
  void unchange(std::size_t k);
  [[nodiscard]] bool has_direction(Index prescribed, double prescribed_rate, Index driven);
  [[nodiscard]] bool release(Index row);
  [[nodiscard]] bool drive(Index row, double limit);
  [[nodiscard]] std::size_t find(Index row) const;
  [[nodiscard]] bool is_active(Index row) const { return (start_.held[row] != 0) != state_[row].changed; }

  const ScaledProblem& problem_;
  Kkt& kkt_;
  Index rows_;
  double rho_ = 1.0, start_objective_ = 0.0, objective_ = 0.0;
  int events_ = 0;
  bool lost_ = false;  // a move ended because too many rows changed, or without a direction
  WorkingSet start_;
  std::vector<RowState> start_state_, state_;  // by row
  // By row: its multiplier if it was active at the start, else its slack. For a changed row this is the value
  // that stays 0, except for the row of the current move.
  Vector start_value_, value_, value_rate_;
  Vector change_;  // of the values while the numbers change and no row becomes active or inactive
  std::vector<Changed> changed_;
  // Responses of all rows to a unit force in a row (a unit slack if the row is active), in order of first
  // use.
  Index capacity_, used_ = 0;
  std::unique_ptr<double[]> responses_;
  std::vector<Index> response_of_row_;
  Vector displacement_;
  BorderedInverse bordered_;  // of the changed rows, as far as directions were computed
  Vector right_side_;
};

}  // namespace marble
