// What a server does at rates beyond its capacity: how much of its work still arrives in time.
#pragma once

#include <functional>
#include <vector>

#include "run/run.h"

namespace marble::load {

/// Measures the capacity, as the rate of a closed loop of two clients a worker, then a run at each level.
/// Requests should have deadlines: an answer that comes is one in time. Ends early with a stop.
[[nodiscard]] Expected<OverloadResult> overload(const RunParts& parts, const Plan& plan,
                                                const std::vector<double>& levels, int workers,
                                                const std::stop_token& stop,
                                                const std::function<void(const OverloadStep&)>& told);

}  // namespace marble::load
