// Generates the arrival times of an open loop, independent of the server.
#pragma once

#include <chrono>
#include <cstdint>
#include <random>

namespace marble::load {

enum class ArrivalProcess {
  fixed,    ///< one every 1/rate seconds
  poisson,  ///< independent of each other: gaps are exponential
};

class Arrivals {
 public:
  /// `rate_per_s` > 0. The same seed gives the same arrivals on every machine.
  Arrivals(ArrivalProcess process, double rate_per_s, std::uint64_t seed);

  /// Returns the next arrival, counted from the start; ascends. The first fixed one comes after one gap.
  [[nodiscard]] std::chrono::nanoseconds next();

 private:
  ArrivalProcess process_;
  double rate_per_s_;
  double at_ns_ = 0.0;
  std::int64_t count_ = 0;
  std::mt19937_64 engine_;
};

/// Returns a number uniform in [0, 1), the same on every machine.
[[nodiscard]] double uniform(std::mt19937_64& engine);

}  // namespace marble::load
