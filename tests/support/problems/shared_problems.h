// The benchmark problems kept beside the checkout, where there are any: $MARBLE_SHARED or ../shared.
#pragma once

#include <filesystem>

#include "marble/problem.h"

namespace marble::testing {

/// The folder of the benchmark problems; it may not exist.
[[nodiscard]] std::filesystem::path shared_benchmarks();

struct SharedProblem {
  OwnedProblem problem;
  double best_known_objective = 0.0;
};

/// Reads one of its JSON files, which are trusted; independent of the client's reader.
[[nodiscard]] SharedProblem read_shared(const std::filesystem::path& file);

}  // namespace marble::testing
