// Simulates a system along a horizon: a feasible point of its LCQP, where bounds allow it.
#pragma once

#include "lcs/small_lcp.h"
#include "marble/lcs.h"

namespace marble {

/// Keeps its memory from one roll-out to the next.
class Rollout {
 public:
  /// Computes x and λ of a trajectory from its u and its first state; all three have their sizes. Errors: as
  /// marble::rollout, of the stage.
  [[nodiscard]] Expected<void> run(const LCS& lcs, LcsTrajectory& trajectory);

 private:
  SmallLcp lcp_;
  Vector offset_;
};

}  // namespace marble
