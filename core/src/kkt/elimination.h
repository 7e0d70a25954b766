// What a factor will look like, without the work of its entries: elimination tree and column counts.
#pragma once

#include <vector>

#include "data/interrupt.h"
#include "kkt/ordering.h"

namespace marble {

/// Of L in LDLᵀ of a matrix with this pattern, in this order.
struct Elimination {
  std::vector<Index> parent;  ///< column of each column's first entry below the diagonal; -1: it has none
  std::vector<Index> counts;  ///< entries below the diagonal, by column
  double entries = 0.0;       ///< all of them
  double flops = 0.0;         ///< of one factorization
};

/// The upper triangle may have its rows in any order within a column. False if it was interrupted.
[[nodiscard]] bool analyse(const Pattern& upper, const Interrupt& interrupt, Elimination& out);

/// The columns, each after all that lead to it: an order in which the factor has the same entries.
[[nodiscard]] std::vector<Index> postorder(const std::vector<Index>& parent);

}  // namespace marble
