// How a solve of a sequence starts: from the last answer, moved on, replaced or forgotten.
#pragma once

#include <span>
#include <vector>

#include "marble/problem.h"

namespace marble {

/// A stretch of a vector that moves on: of `count` entries from `first`, each takes the value `by` further
/// on, and the last `by` keep theirs.
struct ShiftBlock {
  Index first = 0;  ///< >= 0
  Index count = 0;  ///< >= 0; the stretch must lie within the vector
  Index by = 0;     ///< in [0, count]
};

/// A receding horizon's hint: how the last answer moves one stage on before it is started from. The blocks of
/// a vector may move as many entries together as it has; a block that moves none counts as one.
struct Shift {
  std::vector<ShiftBlock> variables = {};     ///< of z, n
  std::vector<ShiftBlock> equalities = {};    ///< of their multipliers, n_e
  std::vector<ShiftBlock> inequalities = {};  ///< of their multipliers, n_i
  std::vector<ShiftBlock> pairs = {};         ///< of both multipliers of the pairs, n_c

  /// For a problem whose vectors all hold `stages` equal parts, one stage after the other. Errors:
  /// invalid_argument of field "stages" unless it is >= 1 and divides the size of every vector.
  [[nodiscard]] static Expected<Shift> by_stage(const ProblemView& problem, int stages);
};

/// Moves the entries of each block, one block after the other. The blocks must lie within `values`.
void shift(std::span<const ShiftBlock> blocks, std::span<double> values);

/// Blocks that move a vector of `size` entries as `first` and after it `then` do, to the last entry. They
/// move no entry twice, however often shifts are joined.
[[nodiscard]] std::vector<ShiftBlock> joined(std::span<const ShiftBlock> first,
                                             std::span<const ShiftBlock> then, std::size_t size);

/// How one solve starts, where it is not simply from the last answer; all of it optional.
struct Restart {
  std::span<const double> initial_z = {};  ///< n or empty: start here instead of at the last answer's z
  bool cold = false;                       ///< forget the last answer
  Shift shift = {};                        ///< the last answer moves on before it is started from

  /// Whether it fits a problem of these sizes. Error fields: "initial_z", "shift.variables[0].count" and
  /// such.
  [[nodiscard]] Expected<void> check(const PartSizes& sizes) const;
};

}  // namespace marble
