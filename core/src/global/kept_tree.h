// The leaves of a tree, for the next tree over the same pairs with other numbers. Together they cover all
// branches, each with the multipliers that bound it or contradict its rows. (Marcucci and Tedrake, "Warm
// start of mixed-integer programs for model predictive control of hybrid systems", 2020.)
#pragma once

#include <utility>
#include <vector>

#include "global/node.h"
#include "marble/restart.h"

namespace marble {

class KeptTree {
 public:
  [[nodiscard]] bool empty() const { return leaves_.empty(); }
  [[nodiscard]] double bytes() const { return bytes_; }

  /// Returns all leaves and keeps none; from now on, added leaves may take this much memory.
  [[nodiscard]] std::vector<Node> replace(double most_bytes);
  /// Adds a leaf. If one does not fit into memory, no leaves are kept.
  void add(const RowLayout& layout, Node leaf);
  /// Sets the sides that a solution has at zero, by pair.
  void set_answer(Fixings sides) { answer_ = std::move(sides); }

  /// Shifts the leaves. A pair whose place no other takes is left open. For a pair that has no place any
  /// more, only leaves with the solution's side at zero are kept.
  void shift(const RowLayout& layout, const Shift& shift);

 private:
  std::vector<Node> leaves_;
  Fixings answer_;
  double bytes_ = 0.0, most_bytes_ = 0.0;
};

}  // namespace marble
