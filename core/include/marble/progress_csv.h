// Progress as CSV: the same columns in the same order wherever a trace is written or read.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "marble/progress.h"

namespace marble {

/// One column of a trace.
struct ProgressColumn {
  std::string_view name;                               ///< as in the header line
  bool integer = false;                                ///< whether its numbers are whole
  double (*get)(const Progress& row) = nullptr;        ///< reads it from a row
  void (*set)(Progress& row, double value) = nullptr;  ///< writes it to a row
};

/// All columns in their order: iteration, outer_iteration, objective, equality_violation,
/// inequality_violation, complementarity_violation, kkt_residual, kappa, rho, step_length, regularization,
/// factorizations, elapsed_s, incumbent, bound, gap, nodes, open_nodes. Violations are in the user's units.
[[nodiscard]] std::span<const ProgressColumn> progress_columns();

/// Traces of before there were trees end with elapsed_s.
inline constexpr std::size_t kColumnsBeforeTrees = 13;

/// The names, separated by commas, without a line break.
[[nodiscard]] std::string progress_csv_header();

/// Appends the row's numbers, separated by commas, without a line break. The shortest text that keeps every
/// bit, whatever the locale; a number that is none is nan, inf or -inf.
void append_progress_csv(const Progress& row, std::string& text);

}  // namespace marble
