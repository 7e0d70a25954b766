// A node of the tree: the sides of pairs that it fixes at zero, its bound, and the rows that its parent's
// optimum held or, if the tree is kept, the multipliers that prove its bound.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "model/rows.h"
#include "model/tuning.h"
#include "path/proof_record.h"

namespace marble {

/// The fixed sides of one pair; both if only s = t = 0 is left.
enum class Sides : std::uint8_t { relaxed = 0, s_zero = 1, t_zero = 2, both_zero = 3 };

[[nodiscard]] inline bool has(Sides sides, Sides side) {
  return (static_cast<unsigned>(sides) & static_cast<unsigned>(side)) != 0;
}
[[nodiscard]] inline bool has_s(Sides sides) { return has(sides, Sides::s_zero); }
[[nodiscard]] inline bool has_t(Sides sides) { return has(sides, Sides::t_zero); }
[[nodiscard]] inline Sides with(Sides sides, bool s) {
  return static_cast<Sides>(static_cast<unsigned>(sides) |
                            static_cast<unsigned>(s ? Sides::s_zero : Sides::t_zero));
}

/// By pair.
using Fixings = std::vector<Sides>;

[[nodiscard]] inline bool is_fixed(const RowLayout& layout, const Fixings& fixings, Index row) {
  return row >= layout.inequalities && has(fixings[static_cast<std::size_t>(layout.pair_of(row))],
                                           layout.is_s(row) ? Sides::s_zero : Sides::t_zero);
}

/// Two bits per pair and one per row, since a tree may hold millions of nodes.
class Node {
 public:
  /// What its multipliers prove.
  enum class Proof : std::uint8_t { none, bound, contradiction };

  double bound = 0.0;       ///< scaled objective
  std::int64_t number = 0;  ///< order of creation
  std::int32_t depth = 0;
  bool exhausted = false;  ///< its point is complementary and was tried as a solution
  Proof proof = Proof::none;
  std::shared_ptr<const LeafMultipliers> record;  ///< the whole proof, if a caller requests it

  Node() = default;
  Node(const RowLayout& layout, const Fixings& fixings, const std::vector<Index>& held)
      : bits_((2 * fixings.size() + static_cast<std::size_t>(layout.size()) + 7) / 8) {
    for (std::size_t pair = 0; pair < fixings.size(); ++pair) {
      set(2 * pair, has_s(fixings[pair]));
      set(2 * pair + 1, has_t(fixings[pair]));
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

  /// Keeps the multipliers of the rows, except those that are negligible beside the largest one; rows with a
  /// multiplier are held from now on.
  void keep(const RowLayout& layout, const Vector& multipliers, Proof what) {
    const std::size_t rows = 2 * static_cast<std::size_t>(layout.pairs);
    const double least = tuning::exactness * max_abs(multipliers);
    multipliers_.clear();
    for (Index row = 0; row < layout.size(); ++row) {
      if (std::abs(multipliers[row]) > least) set(rows + static_cast<std::size_t>(row), true);
      if (get(rows + static_cast<std::size_t>(row))) multipliers_.push_back(multipliers[row]);
    }
    multipliers_.shrink_to_fit();
    proof = what;
  }
  /// Returns the multipliers of all rows, 0 where none was kept.
  [[nodiscard]] Vector multipliers(const RowLayout& layout) const {
    Vector all = Vector::Zero(layout.size());
    std::size_t next = 0;
    for (Index row = 0; row < layout.size() && next < multipliers_.size(); ++row) {
      if (get(2 * static_cast<std::size_t>(layout.pairs) + static_cast<std::size_t>(row)))
        all[row] = multipliers_[next++];
    }
    return all;
  }

  /// Returns the memory of a node of a problem with these rows, and with this number of multipliers.
  [[nodiscard]] static double bytes(const RowLayout& layout, double multipliers) {
    return sizeof(Node) + 16.0 + (2.0 * layout.pairs + layout.size() + 7.0) / 8.0 +
           sizeof(double) * multipliers;
  }
  [[nodiscard]] double bytes(const RowLayout& layout) const {
    return bytes(layout, static_cast<double>(multipliers_.size()));
  }

 private:
  void set(std::size_t bit, bool value) {
    if (value) bits_[bit / 8] |= static_cast<std::uint8_t>(1U << bit % 8);
  }
  [[nodiscard]] bool get(std::size_t bit) const { return (bits_[bit / 8] >> bit % 8 & 1U) != 0; }

  std::vector<std::uint8_t> bits_;
  std::vector<double> multipliers_;  // of the held rows, in their order
};

}  // namespace marble
