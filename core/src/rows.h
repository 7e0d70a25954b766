// One numbering of the rows that may be held at zero: [C z + d; L z + l; R z + r].
#pragma once

#include "linear_algebra.h"

namespace marble {

/// Which rows there are: the inequalities, then the left sides of all pairs, then their right sides.
struct RowLayout {
  Index inequalities = 0;  ///< n_i
  Index pairs = 0;         ///< n_c

  [[nodiscard]] Index size() const { return inequalities + 2 * pairs; }
  [[nodiscard]] Index left(Index pair) const { return inequalities + pair; }
  [[nodiscard]] Index right(Index pair) const { return inequalities + pairs + pair; }
  /// Of a row that is no inequality: which pair it is a side of, and whether the left one.
  [[nodiscard]] Index pair_of(Index row) const { return (row - inequalities) % pairs; }
  [[nodiscard]] bool is_left(Index row) const { return row < right(0); }
  bool operator==(const RowLayout&) const = default;

  /// The part of a vector with a number for each row that belongs to the inequalities, to left or right
  /// sides.
  auto inequality_part(auto&& values) const { return values.segment(0, inequalities); }
  auto left_part(auto&& values) const { return values.segment(inequalities, pairs); }
  auto right_part(auto&& values) const { return values.segment(inequalities + pairs, pairs); }
};

/// A number for each row, at first none in particular.
class RowVector {
 public:
  explicit RowVector(const RowLayout& layout) : all(layout.size()), layout_(layout) {}

  Vector all;

  auto inequality() { return layout_.inequality_part(all); }
  auto left() { return layout_.left_part(all); }
  auto right() { return layout_.right_part(all); }
  [[nodiscard]] auto inequality() const { return layout_.inequality_part(all); }
  [[nodiscard]] auto left() const { return layout_.left_part(all); }
  [[nodiscard]] auto right() const { return layout_.right_part(all); }

 private:
  RowLayout layout_;
};

}  // namespace marble
