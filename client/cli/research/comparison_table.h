// Formats a comparison as tables and pictures.
#pragma once

#include <string>

#include "output/text_table.h"
#include "research/comparison.h"

namespace marble::cli {

/// Returns a row per problem and contestant.
[[nodiscard]] std::string comparison_table(const Comparison& comparison, TableFormat format);

/// Returns the totals per contestant: how many are feasible by either measure, how many solved; and the
/// profile's sentences.
[[nodiscard]] std::string comparison_summary(const Comparison& comparison,
                                             const ComparisonSettings& settings);

/// Returns a line for each missing solution with its reason; empty if there is none.
[[nodiscard]] std::string comparison_faults(const Comparison& comparison);

/// Writes the profile in the format of the file's extension: .png, .svg or .csv. The error's field is the
/// file.
[[nodiscard]] Expected<void> write_profile(const PerformanceProfile& profile, const std::string& title,
                                           const std::string& path);

}  // namespace marble::cli
