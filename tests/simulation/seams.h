// What the simulation replaces of the server's code, by the linker's --wrap: how long a solve takes, where a
// server may crash, and ids, which follow from the seed.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "threads.h"

namespace marble::simulation {

struct Seams {
  /// How long the next solve takes.
  std::function<Duration()> solve_time = [] { return Duration(0); };
  /// Called at each of the server's fault points (base/fault_point.h), on its thread.
  std::function<void(std::string_view name, std::string_view subject)> fault_point = {};
};
/// Set before the first thread starts.
[[nodiscard]] Seams& seams();

}  // namespace marble::simulation
