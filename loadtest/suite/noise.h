// Provides random numbers that are the same for a seed on every machine.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

namespace marble::suite {

class Noise {
 public:
  explicit Noise(std::uint64_t seed) : engine_(seed) {}
  /// Returns a number in [−1, 1).
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-52 - 1.0; }
  /// Returns a number uniform in [1 − size, 1 + size].
  double factor(double size) { return 1.0 + size * uniform(); }
  void apply(std::vector<double>& values, double size) {
    for (double& value : values) value *= factor(size);
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace marble::suite
