// Finds the highest rate at which the server holds an objective.
#pragma once

#include <functional>

#include "plan/objective.h"
#include "run/run.h"

namespace marble::load {

struct RampPlan {
  Objective objective;
  double first_rate_per_s = 10.0;
  double precision = 0.05;   ///< the answer is within this part of the limit
  double most_errors = 0.0;  ///< part of the requests that may fail
  int most_steps = 16;
};

/// Why a run does not hold the objective; empty if it does.
[[nodiscard]] std::string why_not(const RunResult& result, const RampPlan& plan);

/// Doubles the rate until a run does not hold, or halves it until one does; then cuts the gap in halves.
/// Ends early with a stop.
[[nodiscard]] Expected<RampResult> ramp(const RunParts& parts, const Plan& plan, const RampPlan& ramp,
                                        const std::stop_token& stop,
                                        const std::function<void(const RampStep&)>& told);

}  // namespace marble::load
