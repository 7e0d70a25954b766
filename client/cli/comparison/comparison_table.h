// A comparison on paper: tables and pictures.
#pragma once

#include <string>

#include "comparison/comparison.h"
#include "output/text_table.h"

namespace marble::cli {

/// A row a problem and contestant.
[[nodiscard]] std::string comparison_table(const Comparison& comparison, TableFormat format);

/// What all solved, by contestant: how many are feasible by either measure, how many solved; and the
/// profile's sentences.
[[nodiscard]] std::string comparison_summary(const Comparison& comparison,
                                             const ComparisonSettings& settings);

/// Why somebody has no answer, a line each; empty if all have one.
[[nodiscard]] std::string comparison_faults(const Comparison& comparison);

/// Writes the profile as the file's name ends: .png, .svg or .csv. The error's field is the file.
[[nodiscard]] Expected<void> write_profile(const PerformanceProfile& profile, const std::string& title,
                                           const std::string& path);

}  // namespace marble::cli
