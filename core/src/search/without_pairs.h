// The relaxation without complementarity.
#pragma once

#include "data/scaling.h"

namespace marble {

/// The problem where each side of a pair is an inequality.
[[nodiscard]] inline ScaledProblem without_pairs(ScaledProblem problem) {
  problem.layout = {.inequalities = problem.layout.size(), .pairs = 0};
  return problem;
}

}  // namespace marble
