// What a tree has proved, for the next one over the same pairs with other numbers: its leaves, which cover
// all branches together, each with the multipliers that bound it or contradict its rows. (Marcucci and
// Tedrake, "Warm start of mixed-integer programs for model predictive control of hybrid systems", 2020.)
#pragma once

#include <utility>
#include <vector>

#include "marble/restart.h"
#include "tree/node.h"

namespace marble {

class KeptTree {
 public:
  [[nodiscard]] bool empty() const { return leaves_.empty(); }
  [[nodiscard]] double bytes() const { return bytes_; }

  /// All of it, which leaves nothing; from now on so much memory is for what is added.
  [[nodiscard]] std::vector<Node> replace(double most_bytes);
  /// Once something did not fit nothing is kept.
  void add(const RowLayout& layout, Node leaf);
  /// The sides that an answer has at zero, by pair.
  void set_answer(Fixings sides) { answer_ = std::move(sides); }

  /// Moves on as the shift says. A pair that no other takes the place of is left open. Of one that has no
  /// place any more, the branches that have the answer's side at zero are enough.
  void shift(const RowLayout& layout, const Shift& shift);

 private:
  std::vector<Node> leaves_;
  Fixings answer_;
  double bytes_ = 0.0, most_bytes_ = 0.0;
};

}  // namespace marble
