// The process's use of the machine.
#pragma once

#include <cstdint>

namespace marble::server {

struct ProcessUsage {
  std::int64_t resident_bytes = 0;
  double cpu_s = 0.0;  ///< CPU time of all threads, user and system
};

[[nodiscard]] ProcessUsage process_usage();

/// Returns the number of cores that this process may use, at least 1: what taskset, a cpuset or AllowedCPUs=
/// leave of the machine's.
[[nodiscard]] int usable_cores();

/// Raises the limit on descriptors to the process's maximum, and returns the new limit.
std::int64_t raise_descriptor_limit();

struct ProcessFacts {
  int open_fds = 0;
  int threads = 0;
  double start_time_s = 0.0;  ///< Unix time
};

[[nodiscard]] ProcessFacts process_facts();

/// True if every thread except the calling one waits: none runs or is about to.
[[nodiscard]] bool others_wait();

}  // namespace marble::server
