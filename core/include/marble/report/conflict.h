// Why a problem is infeasible: a smallest set of its rows and pairs that no point satisfies (an IIS).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "marble/problem.h"

namespace marble {

/// Parts of a problem that no point satisfies together, whatever the other parts are. All indices are
/// 0-based, ascending and refer to the problem's own rows. A pair 0 ≤ L z + l ⊥ R z + r ≥ 0 has up to three
/// parts: each of its sides is nonnegative, and one of them is zero. If only the sides of a pair are parts,
/// they conflict regardless of its complementarity.
struct Conflict {
  std::vector<Index> equalities;         ///< rows of A z + b = 0
  std::vector<Index> inequalities;       ///< rows of C z + d ≥ 0
  std::vector<Index> left_sides;         ///< pairs whose L z + l ≥ 0 is needed
  std::vector<Index> right_sides;        ///< pairs whose R z + r ≥ 0 is needed
  std::vector<Index> complementarities;  ///< pairs for which L z + l = 0 or R z + r = 0 is needed
  /// Irreducible: if any one of these parts is left out, the others have a point, which was found and is
  /// within the tolerances. False if a limit came first: the parts still conflict, but fewer of them may
  /// conflict too.
  bool minimal = false;
  std::string detail;  ///< one sentence: what was proved, or which limit came first; and the work
  std::int64_t linear_programs = 0;  ///< linear programs solved for it
  std::int32_t factorizations = 0;   ///< their factorizations, which Solution::factorizations includes

  /// Returns the number of parts.
  [[nodiscard]] std::size_t size() const {
    return equalities.size() + inequalities.size() + left_sides.size() + right_sides.size() +
           complementarities.size();
  }
};

}  // namespace marble
