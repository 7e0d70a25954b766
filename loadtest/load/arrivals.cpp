#include "arrivals.h"

#include <cmath>

namespace marble::load {

// The standard's distributions differ between libraries; its engines do not.
double uniform(std::mt19937_64& engine) { return static_cast<double>(engine() >> 11) * 0x1p-53; }

Arrivals::Arrivals(ArrivalProcess process, double rate_per_s, std::uint64_t seed)
    : process_(process), rate_per_s_(rate_per_s), engine_(seed) {}

std::chrono::nanoseconds Arrivals::next() {
  ++count_;
  if (process_ == ArrivalProcess::fixed) {
    at_ns_ = 1e9 * static_cast<double>(count_) / rate_per_s_;  // not a sum of gaps, which would drift
  } else {
    at_ns_ -= 1e9 / rate_per_s_ * std::log1p(-uniform(engine_));
  }
  return std::chrono::nanoseconds(static_cast<std::int64_t>(at_ns_));
}

}  // namespace marble::load
