// The machine a report is from, without its name, and what this process takes of it.
#pragma once

#include <string>

namespace marble::load {

struct Machine {
  std::string processor, system;
  int cores = 0;
  double memory_bytes = 0.0;
};

[[nodiscard]] Machine this_machine();

/// CPU seconds of all threads of this process so far, user and system.
[[nodiscard]] double own_cpu_s();

}  // namespace marble::load
