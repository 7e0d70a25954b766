// Finds the highest rate at which the server meets an objective, and measures it at rates beyond its
// capacity: how much of its work is still in time.
#pragma once

#include <functional>
#include <vector>

#include "objective.h"
#include "run.h"

namespace marble::load {

struct RampPlan {
  Objective objective;
  double first_rate_per_s = 10.0;
  double precision = 0.05;   ///< the result is within this part of the limit
  double most_errors = 0.0;  ///< part of the requests that may fail
  int most_steps = 16;
};

/// Returns why a run does not meet the objective; empty if it does.
[[nodiscard]] std::string why_not(const RunResult& result, const RampPlan& plan);

/// Doubles the rate until a run fails, or halves it until one succeeds; then bisects. A stop ends it early.
[[nodiscard]] Expected<RampResult> ramp(const RunParts& parts, const Plan& plan, const RampPlan& ramp,
                                        const std::stop_token& stop,
                                        const std::function<void(const RampStep&)>& reported);

/// Measures the capacity, as the rate of a closed loop of two clients per worker, then a run at each level.
/// Requests should have deadlines: then every result that arrives is in time. A stop ends it early.
[[nodiscard]] Expected<OverloadResult> overload(const RunParts& parts, const Plan& plan,
                                                const std::vector<double>& levels, int workers,
                                                const std::stop_token& stop,
                                                const std::function<void(const OverloadStep&)>& reported);

}  // namespace marble::load
