// Answers of an LCQP in the terms of the .nl file it was read from, and back.
#pragma once

#include <span>
#include <vector>

#include "marble/solution.h"
#include "nl/nl_problem.h"

namespace marble::formats {

/// Multipliers of an LCQP by its parts; none where a part is empty.
struct MultiplierView {
  std::span<const double> equality, inequality, left, right;

  [[nodiscard]] static MultiplierView of(const Solution& solution);
  /// Of a certificate of infeasibility: y, ν, ξ, η stacked.
  [[nodiscard]] static MultiplierView stacked(const OwnedProblem& problem, std::span<const double> values);
};

/// The sums of the terms, of `count` rows or variables, times `sign`.
[[nodiscard]] std::vector<double> sums(const std::vector<DualTerm>& terms, std::size_t count,
                                       const MultiplierView& multipliers, double sign = 1.0);

/// An answer to begin with, from the file's initial point and dual values: the multipliers of rows are the
/// dual values', those of bounds and of the pairs' right sides what is left of the gradient where the bound
/// holds. Both must be there.
[[nodiscard]] Solution initial_answer(const NlProblem& nl);

}  // namespace marble::formats
