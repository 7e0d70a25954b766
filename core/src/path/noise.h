// Random numbers that are the same on every machine and in every order of calls: splitmix64 (Steele, Lea and
// Flood 2014).
#pragma once

#include <cstdint>

namespace marble {

/// Returns number b of stream a, in [0, 1).
[[nodiscard]] inline double noise(std::uint64_t a, std::uint64_t b) {
  std::uint64_t bits = (a * 0x9e3779b97f4a7c15U + b + 1) * 0x9e3779b97f4a7c15U;
  bits = (bits ^ (bits >> 30U)) * 0xbf58476d1ce4e5b9U;
  bits = (bits ^ (bits >> 27U)) * 0x94d049bb133111ebU;
  return static_cast<double>((bits ^ (bits >> 31U)) >> 11U) * 0x1p-53;
}

/// Returns the same, in [−1, 1).
[[nodiscard]] inline double signed_noise(std::uint64_t a, std::uint64_t b) { return 2.0 * noise(a, b) - 1.0; }

}  // namespace marble
