// Reads the benchmark problems beside the checkout, if there are any: $MARBLE_SHARED or ../shared.
#pragma once

#include <filesystem>

#include "marble/problem.h"

namespace marble::testing {

/// Returns the folder of the benchmark problems; it may not exist.
[[nodiscard]] std::filesystem::path shared_benchmarks();

struct SharedProblem {
  OwnedProblem problem;
  double best_known_objective = 0.0;
};

/// Reads one of its JSON files, which are trusted; independent of the client's reader.
[[nodiscard]] SharedProblem read_shared(const std::filesystem::path& file);

}  // namespace marble::testing
