// Finds rows that are nearly, but not exactly, parallel: an error of one of them moves z by 1/sine times as
// much, and their multipliers grow with the square of this factor.
#pragma once

#include <optional>
#include <string>

#include "search/row_access.h"

namespace marble {

struct ParallelRows {
  Index first, second;  ///< numbered as in RowAccess
  double sine;          ///< of the angle between them
};

/// Returns the two rows with the smallest angle below tuning::parallel_rows, except exact multiples. They are
/// found by a projection, so some may be missed if many rows are alike. O(entries + rows log rows)
[[nodiscard]] std::optional<ParallelRows> nearly_parallel_rows(const ScaledProblem& problem);

/// Formats "ill-conditioned rows A[0] and C[2]: parallel to within 1e-05", with positions in the user's
/// matrices.
[[nodiscard]] std::string describe(const ScaledProblem& problem, const ParallelRows& rows);

}  // namespace marble
