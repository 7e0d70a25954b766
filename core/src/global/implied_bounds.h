// Bounds that rows and pairs imply together, and rows for relaxations that follow from them.
//
// Interval arithmetic over the rows bounds the variables. A side that cannot be zero fixes the other side of
// its pair. Probing fixes each side at zero in turn: with t = 0, s has a largest value S, and with s = 0, t
// has a largest value T. Every feasible point then satisfies
//
//   s / S + t / T ≤ 1,
//
// which the relaxation s, t ≥ 0 does not know. Bounds hold for all points that are feasible within the
// tolerances of the options, and allow for rounding.
#pragma once

#include <cstdint>
#include <vector>

#include "global/node.h"
#include "marble/options.h"
#include "model/interrupt.h"
#include "model/scaling.h"

namespace marble {

class ImpliedBounds {
 public:
  /// The problem must outlive this object.
  ImpliedBounds(const ScaledProblem& problem, const Options& options);

  /// Bounds of the variables, ±∞ where there are none, and the sides that are zero.
  struct Bounds {
    Vector lower, upper;
    Fixings sides;
  };
  /// True if probing costs little enough.
  [[nodiscard]] static bool is_affordable(const ScaledProblem& problem);

  /// True if rows alone do not bound all variables, but rows and pairs do.
  [[nodiscard]] static bool only_pairs_bound(const ScaledProblem& problem, const Options& options);

  enum class End {
    bounded,     ///< what was found holds
    infeasible,  ///< no point is feasible to the tolerances
    stopped,     ///< by the interrupt
  };
  /// Probes all sides, in rounds as long as they bound more of them.
  [[nodiscard]] End probe(const Interrupt& interrupt);

  /// After probe(): what holds for the whole problem.
  [[nodiscard]] const Bounds& bounds() const { return bounds_; }
  /// The largest value of a side, +∞ if none was found.
  [[nodiscard]] double most(Index row) const { return most_[row]; }
  /// Returns the problem with a row of each pair whose sides have a largest value, after its own
  /// inequalities.
  [[nodiscard]] ScaledProblem strengthened() const;

 private:
  [[nodiscard]] bool narrow_all();
  void add_row(Index pair, RowMatrix& rows, std::vector<double>& offsets) const;
  [[nodiscard]] bool narrow_from(Bounds& bounds, const std::vector<Index>& changed) const;
  [[nodiscard]] bool narrow_row(Bounds& bounds, Index row, std::vector<Index>& changed) const;
  [[nodiscard]] double largest(const Bounds& bounds, Index row) const;
  [[nodiscard]] bool probe_side(Index row, bool& gained);

  const ScaledProblem& problem_;
  RowMatrix rows_;  // [A; C; L; R]
  Vector offset_, tolerance_;
  std::vector<Index> column_pointers_, column_rows_;  // the rows of each variable
  Bounds bounds_;
  Vector most_;  // of the rows [C; L; R]
};

}  // namespace marble
