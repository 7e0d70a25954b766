// Defines what Path::algorithm1, which is Algorithm 1 exactly as printed, means for the other options.
#pragma once

#include "marble/options.h"

namespace marble {

[[nodiscard]] inline bool is_printed(const Options& options) { return options.path == Path::algorithm1; }

/// Returns the options in force: Algorithm 1 as printed has no step before it and none after it.
[[nodiscard]] inline Options in_force(Options options) {
  if (is_printed(options)) {
    options.scaling_passes = options.max_local_search_factorizations =
        options.max_feasibility_factorizations = options.max_small_problem_nodes = 0;
    options.polish = false;
  }
  return options;
}

}  // namespace marble
