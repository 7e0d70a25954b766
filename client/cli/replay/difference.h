// Finds the differences of two solutions or two traces, bit for bit.
#pragma once

#include <string>
#include <vector>

#include "marble/v1/job.pb.h"
#include "marble/v1/solution.pb.h"

namespace marble::cli {

/// A difference in one field, or in one column of a trace.
struct Difference {
  std::string field;                  ///< "z", "scenarios.stages[2].objective", "trace.kkt_residual"
  std::int64_t index = -1;            ///< of the first different entry or row; -1 for a single value
  std::string before = {}, now = {};  ///< values at that entry
  std::int64_t entries = 1;           ///< number of different entries
  double largest = 0.0;               ///< largest difference of two finite numbers
};

/// Returns differences in the order of the message. Excludes what varies between runs: times, memory, and
/// options, which are in the request.
[[nodiscard]] std::vector<Difference> differences(const v1::Solution& before, const v1::Solution& now);

/// Compares every row of `before`; `finished`: it has its last one. Also compares the number of iterations,
/// if it is known. `rows` are all rows.
[[nodiscard]] std::vector<Difference> differences(const v1::Trace& before, bool finished,
                                                  const std::vector<v1::Progress>& rows);

}  // namespace marble::cli
