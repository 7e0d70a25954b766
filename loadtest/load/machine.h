// The machine a report is from, without its name.
#pragma once

#include <string>

namespace marble::load {

struct Machine {
  std::string processor, system;
  int cores = 0;
  double memory_bytes = 0.0;
};

[[nodiscard]] Machine this_machine();

}  // namespace marble::load
