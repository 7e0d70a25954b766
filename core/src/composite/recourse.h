// Solves many small independent LCQPs: the recourse of scenarios for a fixed plan, or single scenarios.
// Batches have a fixed size, so that results do not depend on the threads that solve them.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "composite/stages.h"

namespace marble {

/// A scenario's recourse to a plan: the second-stage part of a solution, with the multipliers of a scenario
/// of weight one.
struct Recourse {
  Status status = Status::numerical_failure;
  Solution solution;  ///< in y, and of a scenario's own rows

  [[nodiscard]] bool found() const { return is_solved(status); }
};

/// Controls of the solves in batches.
struct RecourseControls {
  Options options;                              ///< its time limit is ignored
  std::chrono::steady_clock::time_point until;  ///< by the clock of the pause
  std::stop_token stop;
  TaskRunner* runner = nullptr;
  Pause* pause = nullptr;
  std::int64_t most_bytes = std::numeric_limits<std::int64_t>::max();  ///< of the solver of one scenario
};

/// Returns the best recourse of each scenario at x, from `starts[s]` if that is given; starts may be empty. A
/// scenario that was not reached in time has the status time_limit or cancelled.
[[nodiscard]] std::vector<Recourse> solve_recourse(const Stages& stages, std::span<const double> x,
                                                   std::span<const ScenarioNumbers> scenarios,
                                                   std::span<const Solution* const> starts,
                                                   const RecourseControls& controls);

/// Returns the mean cost of the recourses of these scenarios and its confidence interval.
[[nodiscard]] OutOfSample judged(std::span<const ScenarioNumbers> scenarios,
                                 std::span<const Recourse> recourse);

/// Returns the status of each scenario's own LCQP, including its plan.
[[nodiscard]] std::vector<Status> solve_alone(const Stages& stages,
                                              std::span<const ScenarioNumbers> scenarios,
                                              const RecourseControls& controls);

}  // namespace marble
