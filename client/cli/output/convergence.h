// Provides a trace as curves, for the live view and for `marble plot`.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/gnuplot.h"
#include "marble/progress.h"
#include "terminal/terminal_plot.h"

namespace marble::cli {

/// Returns the largest of the three. NaN wins.
[[nodiscard]] double largest(const Violations& violations);

/// True if the step to `row` took more than one factorization because the regularization was raised. Not used
/// in a local search, whose moves regularly take several.
[[nodiscard]] bool repeats_factorization(const Progress& before, const Progress& row);

/// Returns largest violation, KKT residual and κ.
[[nodiscard]] std::vector<Curve> convergence_summary(std::span<const Progress> rows);

/// Returns incumbent and bound of a tree (global search).
[[nodiscard]] std::vector<Curve> proof_summary(std::span<const Progress> rows);

/// True if a tree has begun.
[[nodiscard]] bool has_tree(std::span<const Progress> rows);

/// True if a column belongs on a log axis: violations, residual, κ, ρ, δ, gap.
[[nodiscard]] bool is_logarithmic(const ProgressColumn& column);

/// True if 0 is an ordinary value of the column (a violation, a gap), false if it means that there is none (κ
/// in a local search).
[[nodiscard]] bool zero_counts(const ProgressColumn& column);

/// Returns the curve of one column.
[[nodiscard]] Curve curve_of(std::span<const Progress> rows, const ProgressColumn& column, int number);

// Draws a trace as a picture.

/// Returns gnuplot's commands, data included, which write the picture to standard output: logarithmic columns
/// on one panel, the others on one below, along x, with marks where factorizations were repeated.
[[nodiscard]] std::string trace_picture(std::span<const Progress> rows, const ProgressColumn& x,
                                        std::span<const ProgressColumn* const> columns, PictureFormat format,
                                        const std::string& title);

}  // namespace marble::cli
