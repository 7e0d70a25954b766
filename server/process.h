// What the process takes of the machine.
#pragma once

#include <cstdint>

namespace marble::server {

struct ProcessUsage {
  std::int64_t resident_bytes = 0;
  double cpu_s = 0.0;  ///< of all threads, user and system
};

[[nodiscard]] ProcessUsage process_usage();

}  // namespace marble::server
