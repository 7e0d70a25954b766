// Problems that are made of rows of another one: for proofs, and for directions from a point.
#pragma once

#include <memory>

#include "kkt/kkt.h"
#include "path/run.h"

namespace marble {

/// Appends a copy of one row.
void append_row(const RowMatrix& from, Index row, RowMatrix& to);

/// Appends a copy of all rows.
void append_rows(const RowMatrix& from, RowMatrix& to);

/// Returns the Hessian of ½zᵀz.
[[nodiscard]] SymmetricMatrix identity(Index size);

/// Returns a problem without cost, rows or pairs.
[[nodiscard]] ScaledProblem empty_problem(Index variables);

/// Creates a linear system within the memory that is left to the run beside the problem itself. Returns null
/// if it does not fit, or if interrupted.
[[nodiscard]] std::unique_ptr<Kkt> make_system(const ScaledProblem& problem, const Run& run);

/// Returns the memory of such a system, of the problem, and of the engines that use both.
[[nodiscard]] double system_bytes(const ScaledProblem& problem, const Kkt& kkt);

}  // namespace marble
