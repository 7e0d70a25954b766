// Many small LCQPs that do not depend on each other: the recourse of worlds at a fixed plan, and worlds by
// themselves. In batches of a fixed size, so that who solves them makes no difference.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "scenarios/stages.h"

namespace marble {

/// What a world does with a plan: the second stage's part of an answer, with multipliers of a world of weight
/// one.
struct Recourse {
  Status status = Status::numerical_failure;
  Solution solution;  ///< in y, and of a world's own rows

  [[nodiscard]] bool found() const { return is_solved(status); }
};

/// How the batches are solved.
struct BatchControls {
  Options options;  ///< its time limit is not looked at
  std::chrono::steady_clock::time_point until;
  std::stop_token stop;
  TaskRunner* runner = nullptr;
  std::int64_t most_bytes = std::numeric_limits<std::int64_t>::max();  ///< of a solver of one world
};

/// The best recourse of each world at x, from `starts[s]` where there is one; starts may be empty. A world
/// that was not reached in time has the status time_limit or cancelled.
[[nodiscard]] std::vector<Recourse> solve_recourse(const Stages& stages, std::span<const double> x,
                                                   std::span<const ScenarioNumbers> worlds,
                                                   std::span<const Solution* const> starts,
                                                   const BatchControls& controls);

/// What the recourses come to, of the same worlds: the mean of their costs and its interval.
[[nodiscard]] OutOfSample judged(std::span<const ScenarioNumbers> worlds, std::span<const Recourse> recourse);

/// How each world's own LCQP ends, plan and all.
[[nodiscard]] std::vector<Status> solve_alone(const Stages& stages, std::span<const ScenarioNumbers> worlds,
                                              const BatchControls& controls);

}  // namespace marble
