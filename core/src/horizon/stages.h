// Stages of a problem, found in its pattern: numbers of the variables such that a row, a pair or an entry of
// Q has variables of near stages only.
#pragma once

#include <optional>
#include <vector>

#include "data/interrupt.h"
#include "data/scaling.h"

namespace marble {

struct Stages {
  std::vector<Index> of_variable;  ///< n, from 0 on
  Index count = 0;
};

/// Of the graph whose vertices are the variables, neighbours where a row has both: with d₀ and d₁ the
/// distances from two ends of it that are far apart, d₀ − d₁ grows along it, and changes by 2 at most from a
/// variable to its neighbours. Half of it is the stage. They are counted from the end that has the more
/// equalities: there a state is given. Then each variable moves, a few times, to the mean of the rows that it
/// is in: what a step of a plan has is so of one stage, even where distances along its chains differ.
///
/// Nothing where the graph is not long, with less than tuning::stages_of_widest stages for each variable of
/// the widest, or where it was interrupted. O(entries).
[[nodiscard]] std::optional<Stages> find_stages(const ScaledProblem& problem,
                                                const Interrupt& interrupt = {});

}  // namespace marble
