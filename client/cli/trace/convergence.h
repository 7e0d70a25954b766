// A trace as curves: the same for the live view and for `marble plot`.
#pragma once

#include <span>
#include <vector>

#include "marble/progress.h"
#include "terminal/terminal_plot.h"

namespace marble::cli {

/// The largest of the three. A number that is none wins.
[[nodiscard]] double largest(const Violations& violations);

/// The step to `row` took more than one factorization, so that the regularization was raised. Not so in a
/// local search, whose moves take several as a matter of course.
[[nodiscard]] bool repeats_factorization(const Progress& before, const Progress& row);

/// Largest violation, KKT residual and κ.
[[nodiscard]] std::vector<Curve> convergence_summary(std::span<const Progress> rows);

/// Incumbent and bound of a tree (option global).
[[nodiscard]] std::vector<Curve> proof_summary(std::span<const Progress> rows);

/// Whether a tree has begun.
[[nodiscard]] bool has_tree(std::span<const Progress> rows);

/// Whether a column belongs on a log axis: violations, residual, κ, ρ, δ, gap.
[[nodiscard]] bool is_logarithmic(const ProgressColumn& column);

/// Whether 0 is a value like any other there (a violation, a gap) or says that there is none (κ in a local
/// search).
[[nodiscard]] bool zero_counts(const ProgressColumn& column);

/// A curve of one column.
[[nodiscard]] Curve curve_of(std::span<const Progress> rows, const ProgressColumn& column, int number);

}  // namespace marble::cli
