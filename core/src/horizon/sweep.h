// A long horizon segment by segment: each is solved by itself from where the last one ended, with some stages
// ahead of those that it decides.
#pragma once

#include <span>

#include "marble/solver.h"

namespace marble {

struct SweepPlan {
  std::span<const Index> stage_of_variable;  ///< n; a row has variables of any stages
  std::span<const Index> ends;  ///< of each segment the stage behind its last one; the last is their number
  Index look_ahead = -1;        ///< stages beyond a segment; -1: a third of it, but at least 2
  /// How often, at most, each segment is solved once more with stages before and behind it, between what is
  /// known of the others.
  int passes = 0;
};

/// A segment without an answer is solved once more together with the one before, which may have ended where
/// there is no way on.
///
/// z and multipliers of the whole, feasible where the status says solved; else that of the window that was
/// not, whose name begins the detail. Not stationary: windows know nothing of those behind them. Of the
/// controls it takes what ends it, the runner, and the activity, where segments are parts of a local search.
[[nodiscard]] Expected<Solution> sweep(const Problem& problem, const SweepPlan& plan, const Options& options,
                                       const SolveControls& controls, const SetupControls& setup);

}  // namespace marble
