// The rules of a sparse matrix, whoever gives one.
#pragma once

#include <string>

#include "marble/problem.h"

namespace marble {

/// Whether it has `rows` rows (which are `rows_rule`) and n columns, each with its entries in order, finite.
/// Absent is what has no rows, and Q. The error's field is "<name>.values" and such.
[[nodiscard]] Expected<void> check_matrix(const SparseMatrixView& m, const std::string& name,
                                          std::size_t rows, std::size_t n, const char* rows_rule);

}  // namespace marble
