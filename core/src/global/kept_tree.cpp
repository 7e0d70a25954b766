#include "global/kept_tree.h"

#include <numeric>

namespace marble {
namespace {

// Returns the position from which each entry comes.
std::vector<Index> sources(std::span<const ShiftBlock> blocks, Index size) {
  std::vector<double> places(static_cast<std::size_t>(size));
  std::iota(places.begin(), places.end(), 0.0);
  shift(blocks, places);
  return {places.begin(), places.end()};
}

}  // namespace

std::vector<Node> KeptTree::replace(double most_bytes) {
  bytes_ = 0.0;
  most_bytes_ = most_bytes;
  return std::exchange(leaves_, {});
}

void KeptTree::add(const RowLayout& layout, Node leaf) {
  bytes_ += leaf.bytes(layout);
  if (bytes_ <= most_bytes_) {
    leaves_.push_back(std::move(leaf));
  } else {
    static_cast<void>(replace(0.0));
  }
}

// The shifted leaves still cover all branches: any choice of sides for the remaining pairs, completed by the
// solution's sides for pairs without a place, is a branch that some leaf covers. A pair may therefore take
// only one place.
void KeptTree::shift(const RowLayout& layout, const Shift& by) {
  if (leaves_.empty()) return;
  const std::vector<Index> inequalities = sources(by.inequalities, layout.inequalities);
  const std::vector<Index> pairs = sources(by.pairs, layout.pairs);
  std::vector<Index> place(pairs.size(), -1);  // the place that a pair takes: the first possible one
  for (Index pair = layout.pairs - 1; pair >= 0; --pair) place[static_cast<std::size_t>(pairs[pair])] = pair;
  std::vector<Node> old = replace(most_bytes_);
  Fixings sides, moved(pairs.size());
  std::vector<Index> held;
  for (const Node& leaf : old) {
    leaf.read(layout, sides, held);
    bool needed = true;
    std::ranges::fill(moved, Sides::relaxed);
    for (std::size_t pair = 0; pair < pairs.size(); ++pair) {
      if (place[pair] >= 0) {
        moved[static_cast<std::size_t>(place[pair])] = sides[pair];
      } else if (sides[pair] != Sides::relaxed && sides[pair] != answer_[pair]) {
        needed = false;
      }
    }
    if (!needed) continue;
    const Vector before = leaf.multipliers(layout);
    Vector after(layout.size());
    for (Index row = 0; row < layout.inequalities; ++row) after[row] = before[inequalities[row]];
    for (Index pair = 0; pair < layout.pairs; ++pair) {
      after[layout.s(pair)] = before[layout.s(pairs[pair])];
      after[layout.t(pair)] = before[layout.t(pairs[pair])];
    }
    Node shifted(layout, moved, {});
    shifted.depth = leaf.depth;
    shifted.keep(layout, after, leaf.proof);
    add(layout, std::move(shifted));
  }
  const Fixings answer = answer_;
  for (std::size_t pair = 0; pair < pairs.size(); ++pair) answer_[pair] = answer[pairs[pair]];
}

}  // namespace marble
