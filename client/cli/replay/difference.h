// What two answers or two traces do not have in common, bit for bit.
#pragma once

#include <string>
#include <vector>

#include "marble/v1/job.pb.h"
#include "marble/v1/solution.pb.h"

namespace marble::cli {

/// Of one field, or of one column of a trace.
struct Difference {
  std::string field;                  ///< "z", "scenarios.levels[2].objective", "trace.kkt_residual"
  std::int64_t index = -1;            ///< of the first entry, or row, that differs; -1 of a single value
  std::string before = {}, now = {};  ///< there
  std::int64_t entries = 1;           ///< that differ
  double largest = 0.0;               ///< difference of two numbers that are finite
};

/// In the order of the message. Left out is what differs from run to run: times, memory, and options, which
/// the request has.
[[nodiscard]] std::vector<Difference> differences(const v1::Solution& before, const v1::Solution& now);

/// Of every row that `before` has; `finished`: it has its last one. Besides, the number of iterations where
/// that can be told. `rows` are all of them.
[[nodiscard]] std::vector<Difference> differences(const v1::Trace& before, bool finished,
                                                  const std::vector<v1::Progress>& rows);

}  // namespace marble::cli
