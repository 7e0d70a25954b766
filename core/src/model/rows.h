// Defines one numbering of the rows that may be held at zero: [C z + d; L z + l; R z + r].
#pragma once

#include "model/linear_algebra.h"

namespace marble {

/// The layout of the rows: the inequalities, then the sides s = L z + l of all pairs, then their sides t.
struct RowLayout {
  Index inequalities = 0;  ///< n_i
  Index pairs = 0;         ///< n_c

  [[nodiscard]] Index size() const { return inequalities + 2 * pairs; }
  [[nodiscard]] Index s(Index pair) const { return inequalities + pair; }
  [[nodiscard]] Index t(Index pair) const { return inequalities + pairs + pair; }
  /// For a row that is not an inequality: the pair that it is a side of, and whether it is the side s.
  [[nodiscard]] Index pair_of(Index row) const { return (row - inequalities) % pairs; }
  [[nodiscard]] bool is_s(Index row) const { return row < t(0); }
  bool operator==(const RowLayout&) const = default;

  /// The parts of a vector with one number per row: inequalities, sides s, sides t.
  auto inequality_part(auto&& values) const { return values.segment(0, inequalities); }
  auto s_part(auto&& values) const { return values.segment(inequalities, pairs); }
  auto t_part(auto&& values) const { return values.segment(inequalities + pairs, pairs); }
};

/// One number per row, initially uninitialized.
class RowVector {
 public:
  explicit RowVector(const RowLayout& layout) : all(layout.size()), layout_(layout) {}

  Vector all;

  auto inequality() { return layout_.inequality_part(all); }
  auto s() { return layout_.s_part(all); }
  auto t() { return layout_.t_part(all); }
  [[nodiscard]] auto inequality() const { return layout_.inequality_part(all); }
  [[nodiscard]] auto s() const { return layout_.s_part(all); }
  [[nodiscard]] auto t() const { return layout_.t_part(all); }

 private:
  RowLayout layout_;
};

}  // namespace marble
