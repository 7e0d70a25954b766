// Numbers drawn for the inputs of a fuzz target: the same of the same seed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

namespace marble::fuzz {

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed) {}

  /// In [0, size); 0 of size 0.
  std::size_t below(std::size_t size) { return size == 0 ? 0 : engine_() % size; }
  int between(int low, int high) {
    return low + static_cast<int>(below(static_cast<std::size_t>(high - low + 1)));
  }
  bool chance(int percent) { return between(1, 100) <= percent; }
  /// Of the size of 1, or 0: sums and products of a few are exact.
  double friendly();
  /// Any double that has broken a program before.
  double hostile();
  std::int64_t hostile_integer();

 private:
  std::mt19937_64 engine_;
};

}  // namespace marble::fuzz
