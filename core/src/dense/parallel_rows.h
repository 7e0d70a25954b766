// Rows that are nearly, but not exactly, parallel: an error of one of them moves z by 1/sine times as much,
// and their multipliers grow by its square.
#pragma once

#include <optional>
#include <string>

#include "dense/row_access.h"

namespace marble {

struct ParallelRows {
  Index first, second;  ///< as RowAccess numbers them
  double sine;          ///< of the angle between them
};

/// The two rows with the smallest angle of those below tuning::parallel_rows, exact multiples left out. They
/// are found by a projection, so that some may be missed where many rows are alike. O(entries + rows log
/// rows)
[[nodiscard]] std::optional<ParallelRows> nearly_parallel_rows(const ScaledProblem& problem);

/// "ill-conditioned rows A[0] and C[2]: parallel to within 1e-05", with positions as in the user's matrices.
[[nodiscard]] std::string describe(const ScaledProblem& problem, const ParallelRows& rows);

}  // namespace marble
