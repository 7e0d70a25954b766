// Defines which rows are held at zero. A branch fixes one side of each pair there. The other side is free,
// like every inequality: it is held only while it is active.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "model/scaling.h"

namespace marble {

struct WorkingSet {
  explicit WorkingSet(const ScaledProblem& p) : layout(p.layout), s_fixed(p.pairs()), held(p.layout.size()) {
    for (Index pair = 0; pair < layout.pairs; ++pair) held[layout.t(pair)] = 1;
  }

  RowLayout layout;
  std::vector<std::uint8_t> s_fixed;  ///< n_c: 1 if s = 0 is fixed and t ≥ 0 free, 0 for the opposite
  std::vector<std::uint8_t> held;     ///< by row; 1 for every fixed side
  bool operator==(const WorkingSet&) const = default;

  [[nodiscard]] Index fixed_row(Index pair) const { return s_fixed[pair] ? layout.s(pair) : layout.t(pair); }
  [[nodiscard]] Index free_row(Index pair) const { return s_fixed[pair] ? layout.t(pair) : layout.s(pair); }
  [[nodiscard]] bool is_fixed(Index row) const {
    return row >= layout.inequalities && row == fixed_row(layout.pair_of(row));
  }

  /// Fixes a side of a pair; `free_side_held` says whether the other side is held too.
  void fix(Index pair, bool s, bool free_side_held) {
    s_fixed[pair] = s;
    held[fixed_row(pair)] = 1;
    held[free_row(pair)] = free_side_held;
  }
  /// Switches to the other branch: the free side becomes the fixed one. The other side is held if the free
  /// side was.
  void switch_pair(Index pair) {
    s_fixed[pair] ^= 1U;
    std::swap(held[layout.s(pair)], held[layout.t(pair)]);
  }
  /// Sets the multiplier of every row that is not held to zero.
  void clear_others(VectorRef multipliers) const {
    for (Index row = 0; row < layout.size(); ++row) {
      if (held[row] == 0) multipliers[row] = 0.0;
    }
  }
  /// Calls visit(row) for every row that may be released.
  template <class Visit>
  void for_each_free_row(Visit&& visit) const {
    for (Index row = 0; row < layout.inequalities; ++row) visit(row);
    for (Index pair = 0; pair < layout.pairs; ++pair) visit(free_row(pair));
  }
};

}  // namespace marble
