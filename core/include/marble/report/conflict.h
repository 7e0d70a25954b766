// Why a problem is infeasible: a smallest set of its rows and pairs that no point meets (an IIS).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "marble/problem.h"

namespace marble {

/// Parts of a problem that no point meets together, whatever the others are. All indices are 0-based,
/// ascending and of the problem's own rows. A pair 0 ≤ L z + l ⊥ R z + r ≥ 0 enters by up to three parts:
/// each of its sides being nonnegative, and one of them being zero. One that enters by its sides alone
/// conflicts whatever complements what.
struct Conflict {
  std::vector<Index> equalities;         ///< rows of A z + b = 0
  std::vector<Index> inequalities;       ///< rows of C z + d ≥ 0
  std::vector<Index> left_sides;         ///< pairs of which L z + l ≥ 0 is needed
  std::vector<Index> right_sides;        ///< pairs of which R z + r ≥ 0 is needed
  std::vector<Index> complementarities;  ///< pairs of which L z + l = 0 or R z + r = 0 is needed
  /// Irreducible: without any one of these parts the others have a point, which was found and meets the
  /// tolerances. False where a limit came first: the parts conflict all the same, but fewer of them may.
  bool minimal = false;
  std::string detail;  ///< one sentence: what was proved, or which limit came first; and the work
  std::int64_t linear_programs = 0;  ///< solved for it
  std::int32_t factorizations = 0;   ///< of them; Solution::factorizations has them too

  /// How many parts it has.
  [[nodiscard]] std::size_t size() const {
    return equalities.size() + inequalities.size() + left_sides.size() + right_sides.size() +
           complementarities.size();
  }
};

}  // namespace marble
