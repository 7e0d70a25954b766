// Converts solutions of an LCQP to the terms of its .nl file, and back.
#pragma once

#include <span>
#include <vector>

#include "marble/solution.h"
#include "nl/nl_problem.h"

namespace marble::formats {

/// Multipliers of an LCQP by its parts; empty for an empty part.
struct MultiplierView {
  std::span<const double> equality, inequality, left, right;

  [[nodiscard]] static MultiplierView of(const Solution& solution);
  /// Views a certificate of infeasibility: y, ν, ξ, η stacked.
  [[nodiscard]] static MultiplierView stacked(const OwnedProblem& problem, std::span<const double> values);
};

/// Returns the sums of the terms over `count` rows or variables, times `sign`.
[[nodiscard]] std::vector<double> sums(const std::vector<DualTerm>& terms, std::size_t count,
                                       const MultiplierView& multipliers, double sign = 1.0);

/// Returns a start from the file's initial point and dual values. The multipliers of rows are the dual
/// values; those of bounds and of the pairs' right sides are the rest of the gradient, if the bound is
/// active. The file must have both.
[[nodiscard]] Solution initial_answer(const NlProblem& nl);

}  // namespace marble::formats
