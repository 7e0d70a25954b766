// Approximate minimum degree: an elimination order that keeps the factor sparse.
#pragma once

#include <vector>

#include "marble/problem.h"
#include "model/interrupt.h"

namespace marble {

/// A symmetric pattern by the columns of its upper triangle: rows ascend, and every diagonal entry is
/// present.
struct Pattern {
  std::vector<Index> pointers, rows;
  [[nodiscard]] Index size() const { return static_cast<Index>(pointers.size()) - 1; }
};

/// Orders a pattern as amd_order of SuiteSparse does with its default settings: permutation[k] is the row
/// that is eliminated as number k. Returns false if interrupted.
[[nodiscard]] bool order(const Pattern& pattern, const Interrupt& interrupt, std::vector<Index>& permutation);

}  // namespace marble
