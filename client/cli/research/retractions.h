// Reproduces the paper's section IV.A as a table: its softplus against the exponential, on the same path.
#pragma once

#include <string>
#include <vector>

#include "marble/problem_file.h"
#include "marble/research/conditioning.h"

namespace marble::cli {

/// One problem's path with each retraction.
struct RetractionPair {
  std::string problem;
  PathConditions softplus, exponential;
};

/// Errors: those of the options; cancelled.
[[nodiscard]] Expected<std::vector<RetractionPair>> compare_retractions(
    const std::vector<ProblemFile>& problems, const Options& options, const std::stop_token& stop);

/// Returns a row per problem; then what both solved, and the median condition of ∇r by κ.
[[nodiscard]] std::string retraction_report(const std::vector<RetractionPair>& pairs);

}  // namespace marble::cli
