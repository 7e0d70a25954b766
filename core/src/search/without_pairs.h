// The relaxation without complementarity.
#pragma once

#include "model/scaling.h"

namespace marble {

/// Returns the problem in which each side of a pair is an inequality.
[[nodiscard]] inline ScaledProblem without_pairs(ScaledProblem problem) {
  problem.layout = {.inequalities = problem.layout.size(), .pairs = 0};
  return problem;
}

}  // namespace marble
