// Parametric active set: how the optimum of an elastic branch moves while rows are released or driven to
// zero.
//
// A row is an inequality or a side of a pair: C, then L, then R. From the optimum that ElasticRelaxation
// found, a released row's slack grows until its multiplier is gone, a driven row's slack falls to 0 and stays
// there; between the steps at which other rows become active or inactive everything is linear, and the
// objective quadratic. Rows that differ from the factorized working set are bordered: what unit forces (or
// slacks) in them do to all rows is solved for once per factorization, and a small dense system holds them
// together. One candidate of a local search so costs a few back-substitutions instead of factorizations, and
// is exact. (The homotopy of Best, "An algorithm for the solution of the parametric quadratic programming
// problem", 1982.)
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "branch/elastic_relaxation.h"

namespace marble {

class Parametric {
 public:
  struct Move {
    Index row;
    bool drive;  ///< to zero, and fix it there; else release
  };

  Parametric(const ScaledProblem& problem, Kkt& kkt);
  /// Memory of the responses it keeps, for a problem with this many pairs, and rows as above.
  [[nodiscard]] static double response_bytes(Index pairs, double rows);

  /// From now on moves start at this optimum, whose factor `kkt` must hold.
  void start(const ElasticRelaxation& optimum);

  /// Rows of pair i at the start: the side its branch fixes, and the other one.
  [[nodiscard]] Index fixed_row(Index pair) const { return start_.fixed_row(pair); }
  [[nodiscard]] Index free_row(Index pair) const { return start_.free_row(pair); }
  /// At the start: the multiplier ν of a row that is active (negative where a fixed side would like to
  /// leave), and the slack of one that is not (0 if active).
  [[nodiscard]] double multiplier(Index row) const { return start_.held[row] ? start_value_[row] : 0.0; }
  [[nodiscard]] double slack(Index row) const { return start_.held[row] ? 0.0 : start_value_[row]; }

  /// Makes the moves one after the other. The elastic objective at their end, or nothing as soon as it cannot
  /// end below `cutoff`, or if too many rows change. On the way it may climb by `climb` above the cutoff
  /// while moves that release are still to come.
  [[nodiscard]] std::optional<double> follow(std::span<const Move> moves, double cutoff, double climb);
  /// The working set at the end of the last follow() that succeeded, for the flipped pairs of `set`.
  void read_active_rows(WorkingSet& set) const;

  /// How fast multipliers change at the start while `drive` falls and `release` is free: false if `drive` is
  /// active already.
  [[nodiscard]] bool probe(Index release, Index drive);
  [[nodiscard]] double probed_rate(Index row) const { return value_rate_[row]; }
  [[nodiscard]] double probed_stiffness() const { return std::abs(changed_.back().rate); }  ///< of `drive`

 private:
  struct Changed {
    Index row;
    double value;  // its multiplier if it was inactive at the start, its slack if it was active
    double rate = 0.0;
  };
  // A row on the way: from the start it takes what the moves and events before have made of it.
  struct RowState {
    bool fixed = false;    // it stays at zero whatever its multiplier
    bool changed = false;  // it is active and was not at the start, or the other way round
  };
  void reset();
  [[nodiscard]] const double* response(Index row);
  [[nodiscard]] bool direction(Index prescribed, double prescribed_rate, Index driven);
  [[nodiscard]] Index first_event(double& length, Index driven) const;
  void advance(double length);
  void toggle(Index row);
  [[nodiscard]] bool release(Index row);
  [[nodiscard]] bool drive(Index row, double limit);
  [[nodiscard]] std::size_t find(Index row) const;
  [[nodiscard]] bool is_active(Index row) const { return (start_.held[row] != 0) != state_[row].changed; }

  const ScaledProblem& problem_;
  Kkt& kkt_;
  Index rows_;
  double rho_ = 1.0, start_objective_ = 0.0, objective_ = 0.0;
  int events_ = 0;
  WorkingSet start_;
  std::vector<RowState> start_state_, state_;  // by row
  // By row: its multiplier if it was active at the start, else its slack. Of a changed row that is the one
  // that stays 0, but for the row that a move is about.
  Vector start_value_, value_, value_rate_;
  std::vector<Changed> changed_;
  // Responses of all rows to a unit force in a row (to a unit slack, if it is active), by order of first use.
  Index capacity_, used_ = 0;
  std::unique_ptr<double[]> responses_;
  std::vector<Index> response_of_row_;
  Vector displacement_;
  std::unique_ptr<double[]> bordered_;  // written before it is read: not filled with zeros first
  std::vector<double> right_side_;
  std::vector<int> pivots_;
};

}  // namespace marble
