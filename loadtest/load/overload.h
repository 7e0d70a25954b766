// Measures a server at rates beyond its capacity: how much of its work is still in time.
#pragma once

#include <functional>
#include <vector>

#include "run.h"

namespace marble::load {

/// Measures the capacity, as the rate of a closed loop of two clients per worker, then a run at each level.
/// Requests should have deadlines: then every result that arrives is in time. A stop ends it early.
[[nodiscard]] Expected<OverloadResult> overload(const RunParts& parts, const Plan& plan,
                                                const std::vector<double>& levels, int workers,
                                                const std::stop_token& stop,
                                                const std::function<void(const OverloadStep&)>& reported);

}  // namespace marble::load
