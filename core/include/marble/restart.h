// How a solve of a sequence starts: from the last solution, shifted, replaced or discarded.
#pragma once

#include <span>
#include <vector>

#include "marble/problem.h"

namespace marble {

/// A range of a vector that shifts: of `count` entries from `first`, each takes the value `by` places further
/// on, and the last `by` keep theirs.
struct ShiftBlock {
  Index first = 0;  ///< >= 0
  Index count = 0;  ///< >= 0; the range must lie within the vector
  Index by = 0;     ///< in [0, count]
};

/// A hint for receding horizons: how the last solution shifts by one stage before the solve starts from it.
/// The blocks of a vector may together move as many entries as it has; a block that moves none counts as one.
struct Shift {
  std::vector<ShiftBlock> variables = {};     ///< of z, n
  std::vector<ShiftBlock> equalities = {};    ///< of their multipliers, n_e
  std::vector<ShiftBlock> inequalities = {};  ///< of their multipliers, n_i
  std::vector<ShiftBlock> pairs = {};         ///< of both multipliers of the pairs, n_c

  /// Returns the shift of a problem whose vectors all consist of `stages` equal parts, one stage after the
  /// other. Errors: invalid_argument of field "stages" unless it is >= 1 and divides the size of every
  /// vector.
  [[nodiscard]] static Expected<Shift> by_stage(const ProblemView& problem, int stages);
};

/// Shifts the entries of each block, one block after the other. The blocks must lie within `values`.
void shift(std::span<const ShiftBlock> blocks, std::span<double> values);

/// Returns blocks that shift a vector of `size` entries as `first` followed by `then` would, for every entry.
/// They move no entry twice, however often shifts are joined.
[[nodiscard]] std::vector<ShiftBlock> joined(std::span<const ShiftBlock> first,
                                             std::span<const ShiftBlock> then, std::size_t size);

/// How one solve starts, if not just from the last solution; all members are optional.
struct Restart {
  std::span<const double> initial_z = {};  ///< n or empty: starting point instead of the last solution's z
  bool cold = false;                       ///< discard the last solution
  Shift shift = {};                        ///< shift of the last solution before the solve starts from it

  /// Checks that it fits a problem of these sizes. Error fields: "initial_z", "shift.variables[0].count", ….
  [[nodiscard]] Expected<void> check(const PartSizes& sizes) const;
};

}  // namespace marble
