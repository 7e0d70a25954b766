// Solves a long horizon segment by segment. Each segment is solved alone from the end of the previous one,
// with some overlap stages beyond those that it decides.
#pragma once

#include <span>

#include "marble/solver.h"

namespace marble {

struct SweepPlan {
  std::span<const Index> stage_of_variable;  ///< n; a row may have variables of any stages
  std::span<const Index> ends;  ///< stage after the last one of each segment; the last end is the count
  Index overlap = -1;           ///< stages beyond a segment; -1: a third of its length, but at least 2
  /// Maximum number of passes that solve each segment again, with stages before and after it, between the
  /// current values of the other segments.
  int passes = 0;
};

/// Solves all segments. A segment without a solution is solved once more together with the previous one,
/// which may have ended in a dead end.
///
/// Returns z and multipliers of the whole problem, feasible if the status is solved. Otherwise the status is
/// that of the unsolved window, whose name begins the detail. The point is not stationary, because windows
/// ignore later windows. Of the controls it uses the stop token, start time, pause and runner, and the
/// activity if the segments are parts of a local search.
[[nodiscard]] Expected<Solution> sweep(const Problem& problem, const SweepPlan& plan, const Options& options,
                                       const SolveControls& controls, const SetupControls& setup);

}  // namespace marble
