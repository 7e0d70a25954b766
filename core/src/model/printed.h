// Path::algorithm1, which is Algorithm 1 as printed and nothing else: what that means for the options.
#pragma once

#include "marble/options.h"

namespace marble {

[[nodiscard]] inline bool is_printed(const Options& options) { return options.path == Path::algorithm1; }

/// The options in force: what is as printed has nothing before it and nothing after it.
[[nodiscard]] inline Options in_force(Options options) {
  if (is_printed(options)) {
    options.scaling_passes = options.local_search_budget = options.feasibility_budget = options.small_budget =
        0;
    options.polish = false;
  }
  return options;
}

}  // namespace marble
