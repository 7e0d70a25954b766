// Generates problems whose difficulty is to find a feasible point at all, and small ones with many local
// minima.
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
  std::optional<Status> proof;         ///< the only correct status; none: it is feasible, and bounded below
  std::optional<double> optimum = {};  ///< if known: no other objective is correct
};

/// Returns all families, `seeds` problems of each random one: odd seeds, for tuning, or even ones, for
/// judging.
[[nodiscard]] std::vector<HardProblem> hard_problems(int seeds, bool judging);

/// Adds problems whose rows are nearly parallel: a question of accuracy, not of search.
void add_parallel_rows(std::vector<HardProblem>& all, int seeds, bool judging);

/// Adds problems from the literature.
void add_published(std::vector<HardProblem>& all);

}  // namespace marble::suite
