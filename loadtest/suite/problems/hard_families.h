// Problems made by formula whose difficulty is to find a feasible point at all, and small ones whose local
// minima are many.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "marble/problem.h"
#include "marble/solution.h"

namespace marble::suite {

struct HardProblem {
  std::string family;
  OwnedProblem problem;
  std::optional<Status> proof;         ///< the only right answer; none: it is feasible, and bounded below
  std::optional<double> optimum = {};  ///< where it is known: no other answer is right
};

/// All families, `seeds` problems of each random one: odd seeds, which numbers may be tuned on, or even ones,
/// which judge.
[[nodiscard]] std::vector<HardProblem> hard_problems(int seeds, bool judging);

/// Those whose rows are nearly parallel: a matter of accuracy, not of search.
void add_parallel_rows(std::vector<HardProblem>& all, int seeds, bool judging);

/// Those of the literature.
void add_published(std::vector<HardProblem>& all);

}  // namespace marble::suite
