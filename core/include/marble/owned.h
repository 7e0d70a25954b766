// Copies of views, for those who keep a problem longer than its arrays.
#pragma once

#include "marble/problem.h"

namespace marble {

/// Returns a copy of the matrix.
[[nodiscard]] SparseMatrix owned(const SparseMatrixView& view);
/// Returns a copy of the problem, without a name.
[[nodiscard]] OwnedProblem owned(const ProblemView& view);

}  // namespace marble
