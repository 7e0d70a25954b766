// Random vectors of a seed of their own, the same on every machine.
#pragma once

#include <cstdint>
#include <random>

#include "model/linear_algebra.h"

namespace marble::testing {

class RandomVectors {
 public:
  explicit RandomVectors(std::uint64_t seed) : engine_(seed) {}
  /// Entries in [−1, 1).
  [[nodiscard]] Vector next(Eigen::Index size) {
    Vector x(size);
    for (double& value : x) value = static_cast<double>(engine_() >> 11) * 0x1p-52 - 1.0;
    return x;
  }
  void fill(Vector& x) { x = next(x.size()); }

 private:
  std::mt19937_64 engine_;
};

}  // namespace marble::testing
