// What the process takes of the machine.
#pragma once

#include <cstdint>

namespace marble::server {

struct ProcessUsage {
  std::int64_t resident_bytes = 0;
  double cpu_s = 0.0;  ///< of all threads, user and system
};

[[nodiscard]] ProcessUsage process_usage();

/// Cores that this process may run on, at least 1: what taskset, a cpuset or AllowedCPUs= left it of the
/// machine's.
[[nodiscard]] int usable_cores();

/// Asks for as many descriptors as the process may have at all, and returns how many it now may have.
std::int64_t raise_descriptor_limit();

struct ProcessFacts {
  int open_fds = 0;
  int threads = 0;
  double start_time_s = 0.0;  ///< in Unix time
};

[[nodiscard]] ProcessFacts process_facts();

/// Whether every thread but the calling one waits for something: none runs or is about to.
[[nodiscard]] bool others_wait();

}  // namespace marble::server
