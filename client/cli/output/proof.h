// Describes the progress of a global search in words.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "marble/progress.h"
#include "marble/solution.h"

namespace marble::cli {

/// The tree's values in a solution or a job.
struct Proof {
  std::optional<Status> status;  ///< none while it runs
  bool proved = false;
  double bound = 0.0, gap = 0.0;
  std::int64_t nodes = 0, open_nodes = 0;
};

template <class Reported>
[[nodiscard]] Proof proof_of(const Reported& reported) {
  return {reported.status, reported.proved, reported.bound,
          reported.gap,    reported.nodes,  reported.open_nodes};
}

/// "proved optimal: gap 3.0e-07, 1,204 nodes", "proved infeasible: 12 nodes",
/// "not proved: bound -4.25, gap 6.1e-02, 1,204 nodes, 37 open"; empty without a tree.
[[nodiscard]] std::string proof_text(const Proof& proof);

/// Returns a number such as "1,204".
[[nodiscard]] std::string whole_text(std::int64_t count);

/// Returns nodes per second at the newest row, over the last tenth of the time; nothing without a tree.
[[nodiscard]] std::optional<double> nodes_per_s(std::span<const Progress> rows);

}  // namespace marble::cli
