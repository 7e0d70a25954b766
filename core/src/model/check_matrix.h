// Provides the rules of a sparse matrix, for all callers.
#pragma once

#include <string>

#include "marble/problem.h"

namespace marble {

/// When a matrix may be empty: only if it would have no rows, or always.
enum class MayBeEmpty { without_rows, always };

/// Checks a sparse matrix; all input passes through here. An empty matrix has no rows, no columns and no
/// entry in any array. Any other must have `rows` rows (described by `rows_rule`) and n columns, and its
/// entries must be in order and finite. The error's field is "<name>.values" and similar.
[[nodiscard]] Expected<void> check_matrix(const SparseMatrixView& m, const std::string& name,
                                          std::size_t rows, std::size_t n, const char* rows_rule,
                                          MayBeEmpty may_be_empty = MayBeEmpty::without_rows);

}  // namespace marble
