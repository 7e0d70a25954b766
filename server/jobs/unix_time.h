// Times as messages and files have them: seconds since 1970, UTC.
#pragma once

#include <chrono>

namespace marble::server {

[[nodiscard]] inline double unix_s(std::chrono::system_clock::time_point time) {
  return std::chrono::duration<double>(time.time_since_epoch()).count();
}

[[nodiscard]] inline std::chrono::system_clock::time_point time_of(double unix_s) {
  return std::chrono::system_clock::time_point(
      std::chrono::duration_cast<std::chrono::system_clock::duration>(std::chrono::duration<double>(unix_s)));
}

}  // namespace marble::server
