// A node of the tree: which sides of pairs it fixes at zero, what is known of its bound, and the rows that
// its parent's optimum held.
#pragma once

#include <cstdint>
#include <vector>

#include "data/rows.h"

namespace marble {

/// Of one pair; both where s = t = 0 is all that is left.
enum class Sides : std::uint8_t { relaxed = 0, s_zero = 1, t_zero = 2, both_zero = 3 };

/// By pair.
using Fixings = std::vector<Sides>;

/// Two bits a pair and one a row: a tree may hold millions.
class Node {
 public:
  double bound = 0.0;       ///< scaled objective
  std::int64_t number = 0;  ///< in the order of making
  std::int32_t depth = 0;
  bool exhausted = false;  ///< its point is complementary, and was tried as an answer

  Node() = default;
  Node(const RowLayout& layout, const Fixings& fixings, const std::vector<Index>& held)
      : bits_((2 * fixings.size() + static_cast<std::size_t>(layout.size()) + 7) / 8) {
    for (std::size_t pair = 0; pair < fixings.size(); ++pair) {
      set(2 * pair, (static_cast<unsigned>(fixings[pair]) & 1U) != 0);
      set(2 * pair + 1, (static_cast<unsigned>(fixings[pair]) & 2U) != 0);
    }
    for (const Index row : held) set(2 * fixings.size() + static_cast<std::size_t>(row), true);
  }

  void read(const RowLayout& layout, Fixings& fixings, std::vector<Index>& held) const {
    const auto pairs = static_cast<std::size_t>(layout.pairs);
    fixings.resize(pairs);
    for (std::size_t pair = 0; pair < pairs; ++pair)
      fixings[pair] = static_cast<Sides>((get(2 * pair) ? 1U : 0U) | (get(2 * pair + 1) ? 2U : 0U));
    held.clear();
    for (Index row = 0; row < layout.size(); ++row) {
      if (get(2 * pairs + static_cast<std::size_t>(row))) held.push_back(row);
    }
  }

  /// Memory of one, of a problem with such rows.
  [[nodiscard]] static double bytes(const RowLayout& layout) {
    return sizeof(Node) + 16.0 + (2.0 * layout.pairs + layout.size() + 7.0) / 8.0;
  }

 private:
  void set(std::size_t bit, bool value) {
    if (value) bits_[bit / 8] |= static_cast<std::uint8_t>(1U << bit % 8);
  }
  [[nodiscard]] bool get(std::size_t bit) const { return (bits_[bit / 8] >> bit % 8 & 1U) != 0; }

  std::vector<std::uint8_t> bits_;
};

}  // namespace marble
