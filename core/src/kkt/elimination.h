// Predicts the structure of a factor without computing its entries: elimination tree and column counts.
#pragma once

#include <vector>

#include "kkt/ordering.h"
#include "model/interrupt.h"

namespace marble {

/// Describes L in LDLᵀ of a matrix with this pattern, in this order.
struct Elimination {
  std::vector<Index> parent;  ///< column of each column's first entry below the diagonal; -1 if there is none
  std::vector<Index> counts;  ///< entries below the diagonal, by column
  double entries = 0.0;       ///< sum of the counts
  double flops = 0.0;         ///< of one factorization
};

/// Analyses an upper triangle; the rows of a column may be in any order. Returns false if interrupted.
[[nodiscard]] bool analyse(const Pattern& upper, const Interrupt& interrupt, Elimination& out);

/// Returns the columns in postorder: each after its descendants. The factor has the same entries in this
/// order.
[[nodiscard]] std::vector<Index> postorder(const std::vector<Index>& parent);

}  // namespace marble
