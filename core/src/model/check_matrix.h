// The rules of a sparse matrix, whoever gives one.
#pragma once

#include <string>

#include "marble/problem.h"

namespace marble {

/// Whether a matrix may be empty although it would have rows.
enum class MayBeEmpty { without_rows, always };

/// The one gate of sparse matrices. An empty one has no rows, no columns and no entry in any array; any other
/// must have `rows` rows (which are `rows_rule`) and n columns, each with its entries in order, finite. The
/// error's field is "<name>.values" and such.
[[nodiscard]] Expected<void> check_matrix(const SparseMatrixView& m, const std::string& name,
                                          std::size_t rows, std::size_t n, const char* rows_rule,
                                          MayBeEmpty may_be_empty = MayBeEmpty::without_rows);

}  // namespace marble
