// Counter-based random numbers: sample i depends only on the seed and on i. It has the same bits on every
// machine, regardless of how many others are drawn and in which order. For nested samples.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace marble {

/// Philox4x32-10 (J. Salmon, M. Moraes, R. Dror, D. Shaw, "Parallel Random Numbers: As Easy as 1, 2, 3", SC
/// 2011): ten rounds mix a counter of four words with a key of two.
[[nodiscard]] constexpr std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter,
                                                            std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53} * counter[0];
    const std::uint64_t b = std::uint64_t{0xCD9E8D57} * counter[2];
    counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(b),
               static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key = {key[0] + 0x9E3779B9u, key[1] + 0xBB67AE85u};
  }
  return counter;
}

/// A sequence of samples, each with as many numbers as needed.
class CounterRandom {
 public:
  /// Sets the seed, which determines all numbers.
  explicit constexpr CounterRandom(std::uint64_t seed) : key_{low(seed), high(seed)} {}

  /// Returns number `number` of sample `sample`: uniform in [0, 1), a multiple of 2⁻⁵³.
  [[nodiscard]] constexpr double uniform(std::uint64_t sample, std::uint32_t number = 0) const {
    const auto words = philox({low(sample), high(sample), number / 2, 0}, key_);
    const std::size_t first = number % 2 == 0 ? 0 : 2;
    const std::uint64_t bits = (std::uint64_t{words[first + 1]} << 32) | words[first];
    return static_cast<double>(bits >> 11) * 0x1p-53;
  }

 private:
  static constexpr std::uint32_t low(std::uint64_t value) { return static_cast<std::uint32_t>(value); }
  static constexpr std::uint32_t high(std::uint64_t value) { return static_cast<std::uint32_t>(value >> 32); }

  std::array<std::uint32_t, 2> key_;
};

}  // namespace marble
