// What other solvers reached on the same problems, as recorded beside the benchmarks.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "marble/problem.h"
#include "peers/performance_profile.h"
#include "record.h"

namespace marble::suite {

/// Milliseconds of each peer for each of our records, infinity where its answer is infeasible beyond 1e-5 or
/// more than 1e-3 above the reference; ours by the same rule. Empty if the file is not there.
[[nodiscard]] Times read_peers(const std::filesystem::path& csv, const std::vector<Record>& ours);

/// A problem as client/FORMATS.md says, for a script that asks other solvers.
void write_json(const OwnedProblem& p, const std::string& file);

}  // namespace marble::suite
