// Approximate minimum degree: an order of elimination that keeps the factor sparse.
#pragma once

#include <vector>

#include "data/interrupt.h"
#include "marble/problem.h"

namespace marble {

/// A symmetric pattern by the columns of its upper triangle: rows ascending, each diagonal entry there.
struct Pattern {
  std::vector<Index> pointers, rows;
  [[nodiscard]] Index size() const { return static_cast<Index>(pointers.size()) - 1; }
};

/// permutation[k] is the row that is eliminated as number k: what amd_order of SuiteSparse gives with its
/// default settings. False if it was interrupted.
[[nodiscard]] bool order(const Pattern& pattern, const Interrupt& interrupt, std::vector<Index>& permutation);

}  // namespace marble
