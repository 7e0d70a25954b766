// Describes the machine of a report, without its name, and this process's use of it.
#pragma once

#include <string>

namespace marble::load {

struct Machine {
  std::string processor, system;
  int cores = 0;
  double memory_bytes = 0.0;
};

[[nodiscard]] Machine this_machine();

/// Returns CPU seconds of all threads of this process so far, user and system.
[[nodiscard]] double own_cpu_s();

}  // namespace marble::load
