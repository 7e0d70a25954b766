// Times in the form of messages and files: seconds since 1970, UTC.
#pragma once

#include <algorithm>
#include <chrono>

namespace marble::server {

[[nodiscard]] inline double unix_s(std::chrono::system_clock::time_point time) {
  return std::chrono::duration<double>(time.time_since_epoch()).count();
}

/// Clamped to the years 1970 to 2100, because a file may contain any number.
[[nodiscard]] inline std::chrono::system_clock::time_point time_of(double unix_s) {
  constexpr double kLatest = 4102444800.0;
  unix_s = unix_s > 0.0 ? std::min(unix_s, kLatest) : 0.0;
  return std::chrono::system_clock::time_point(
      std::chrono::duration_cast<std::chrono::system_clock::duration>(std::chrono::duration<double>(unix_s)));
}

}  // namespace marble::server
