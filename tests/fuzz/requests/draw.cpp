#include "requests/draw.h"

#include <array>
#include <bit>
#include <limits>

namespace marble::fuzz {
namespace {

using Real = std::numeric_limits<double>;

constexpr std::array kFriendly = {0.0, 1.0, -1.0, 2.0, -2.0, 0.5, -0.5, 3.0, -3.0, 0.25, 1.5, -4.0, 10.0};
constexpr std::array kHostile = {0.0,
                                 -0.0,
                                 Real::denorm_min(),
                                 Real::min(),
                                 1e-300,
                                 1e-200,
                                 1e-20,
                                 1e-14,
                                 1e-12,
                                 1e-8,
                                 1e-6,
                                 1.0 + 1e-15,
                                 1e6,
                                 1e8,
                                 1e12,
                                 1e16,
                                 1e20,
                                 1e38,
                                 1e100,
                                 1e150,
                                 1e154,
                                 1e200,
                                 1e300,
                                 Real::max(),
                                 Real::infinity(),
                                 Real::quiet_NaN(),
                                 4294967296.0,
                                 2147483647.0};
constexpr std::array<std::int64_t, 16> kIntegers = {
    0, 1, 2, 3, 4, 7, 8, 63, 64, 65, 1000, 65536, INT32_MAX, INT32_MIN, INT64_MAX, INT64_MIN};

}  // namespace

double Draw::friendly() { return kFriendly[below(kFriendly.size())]; }

double Draw::hostile() {
  if (chance(5)) return std::bit_cast<double>(engine_());
  const double value = kHostile[below(kHostile.size())];
  return chance(50) ? value : -value;
}

std::int64_t Draw::hostile_integer() {
  const std::int64_t value = kIntegers[below(kIntegers.size())];
  return chance(70) ? value : static_cast<std::int64_t>(0 - static_cast<std::uint64_t>(value));
}

}  // namespace marble::fuzz
