// Provides what trees over pairs share about nogoods: sets of sides that cannot all be zero.
//
// Sides are numbered: 2 k is s of pair k, 2 k + 1 is t. A node stores for each pair 1 if s, 2 if t is zero in
// it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <vector>

#include "model/linear_algebra.h"
#include "model/tuning.h"

namespace marble {

/// True if all these sides are zero in a node.
[[nodiscard]] inline bool are_zero(const std::vector<Index>& sides, const std::vector<std::uint8_t>& zero) {
  return std::ranges::all_of(
      sides, [&zero](Index side) { return zero[static_cast<std::size_t>(side / 2)] == side % 2 + 1; });
}

/// The union of two ascending lists.
[[nodiscard]] inline std::vector<Index> united(const std::vector<Index>& a, const std::vector<Index>& b) {
  std::vector<Index> both;
  std::ranges::set_union(a, b, std::back_inserter(both));
  return both;
}

/// Bounds the memory of what a tree keeps.
class NogoodMemory {
 public:
  /// True if so many more numbers may be kept; counts them.
  [[nodiscard]] bool may_keep(std::size_t numbers) {
    if (kept_ + static_cast<double>(numbers) > tuning::conflict_entries) return false;
    kept_ += static_cast<double>(numbers);
    return true;
  }

 private:
  double kept_ = 0.0;
};

}  // namespace marble
