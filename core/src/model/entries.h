// Provides indices into vectors and loops over matrix entries, in the user's form.
#pragma once

#include <cstddef>

#include "marble/problem.h"

namespace marble {

inline std::size_t at(Index i) { return static_cast<std::size_t>(i); }

/// Calls visit(row, value) for every stored entry of column j; an empty matrix has none.
template <class Visit>
void for_column(const SparseMatrixView& m, Index j, const Visit& visit) {
  if (m.columns == 0) return;
  for (Index k = m.column_pointers[at(j)]; k < m.column_pointers[at(j) + 1]; ++k)
    visit(m.row_indices[at(k)], m.values[at(k)]);
}

/// Calls visit(row, column, value) for every stored entry, column by column.
template <class Visit>
void for_entries(const SparseMatrixView& m, const Visit& visit) {
  for (Index j = 0; j < m.columns; ++j)
    for_column(m, j, [&](Index row, double value) { visit(row, j, value); });
}

}  // namespace marble
