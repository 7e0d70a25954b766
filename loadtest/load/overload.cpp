#include "overload.h"

namespace marble::load {

Expected<OverloadResult> overload(const RunParts& parts, const Plan& plan, const std::vector<double>& levels,
                                  int workers, const std::stop_token& stop,
                                  const std::function<void(const OverloadStep&)>& reported) {
  OverloadResult result;
  Plan closed = plan;
  closed.loop = Loop::closed;
  closed.clients = 2 * workers;
  auto capacity = run(parts, closed, stop);
  if (!capacity) return unexpected(capacity.error());
  result.capacity_per_s = capacity->answers_per_s;
  for (const double level : levels) {
    if (stop.stop_requested() || result.capacity_per_s <= 0.0) break;
    Plan one = plan;
    one.loop = Loop::open;
    one.rate_per_s = level * result.capacity_per_s;
    auto measured = run(parts, one, stop);
    if (!measured) return unexpected(measured.error());
    result.steps.push_back({level, result.capacity_per_s, std::move(*measured)});
    if (reported) reported(result.steps.back());
  }
  return result;
}

}  // namespace marble::load
