// Finds stages of a problem in its pattern: numbers of the variables such that a row, a pair or an entry of Q
// has only variables of nearby stages.
#pragma once

#include <optional>
#include <vector>

#include "model/interrupt.h"
#include "model/scaling.h"

namespace marble {

struct Stages {
  std::vector<Index> of_variable;  ///< n, numbered from 0
  Index count = 0;
};

/// Finds stages in the graph whose vertices are the variables, with variables of a common row as neighbours.
/// Let d₀ and d₁ be the distances from two ends that are far apart. Then d₀ − d₁ grows along the graph and
/// differs by at most 2 between neighbours; half of it is the stage. Stages are counted from the end with
/// more equalities, because a state is given there. Then each variable moves, a few times, to the mean of its
/// rows, so that the variables of one step of a plan get one stage even if distances along its chains differ.
///
/// Returns nothing if the graph is not long, with fewer than tuning::stages_of_widest stages for each
/// variable of the widest stage, or if interrupted. O(entries).
[[nodiscard]] std::optional<Stages> find_stages(const ScaledProblem& problem,
                                                const Interrupt& interrupt = {});

}  // namespace marble
