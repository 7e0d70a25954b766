// The tree follows Liu, "The role of elimination trees in sparse factorization", 1990. The counts follow
// Gilbert, Ng, Peyton, "An efficient algorithm to compute row and column counts for sparse Cholesky
// factorization", 1994. Both take little more time than reading each entry of the matrix once.
#include "kkt/elimination.h"

#include <algorithm>
#include <numeric>

namespace marble {
namespace {

// Visits every node of a tree after its children, and clears `first_child` on the way. The tree is given by
// each node's first child and next sibling, -1 if there is none. `stack` has space for all nodes.
template <class Visit>
void visit_postorder(Index root, Index* first_child, const Index* sibling, Index* stack, Visit&& visit) {
  stack[0] = root;
  for (Index top = 0; top >= 0;) {
    const Index node = stack[top];
    if (first_child[node] < 0) {
      --top;
      visit(node);
      continue;
    }
    for (Index child = first_child[node]; child >= 0; child = sibling[child]) ++top;
    Index place = top;
    for (Index child = first_child[node]; child >= 0; child = sibling[child]) stack[place--] = child;
    first_child[node] = -1;
  }
}

constexpr Index kNone = -1;

// Row k of L contains the columns on the paths from the row's entries up to k. The first path that reaches a
// node without a parent makes k its parent. `ancestor` stores the far end of each path (path compression).
bool find_parents(const Pattern& upper, Checkpoint& checkpoint, std::vector<Index>& parent,
                  std::vector<Index>& ancestor) {
  for (Index k = 0; k < upper.size(); ++k) {
    parent[k] = ancestor[k] = kNone;
    for (Index at = upper.pointers[k]; at < upper.pointers[k + 1]; ++at) {
      for (Index i = upper.rows[at]; i != kNone && i < k;) {
        const Index next = ancestor[i];
        ancestor[i] = k;
        if (next == kNone) parent[i] = k;
        i = next;
      }
    }
    if (checkpoint.reached(upper.pointers[k + 1] - upper.pointers[k])) return false;
  }
  return true;
}

// Returns each column's entries below the diagonal.
Pattern transposed(const Pattern& upper) {
  const auto n = static_cast<std::size_t>(upper.size());
  Pattern lower{std::vector<Index>(n + 2, 0), std::vector<Index>(upper.rows.size())};
  for (const Index row : upper.rows) ++lower.pointers[row + 2];
  std::partial_sum(lower.pointers.begin(), lower.pointers.end(), lower.pointers.begin());
  for (Index column = 0; column < upper.size(); ++column) {
    for (Index at = upper.pointers[column]; at < upper.pointers[column + 1]; ++at)
      lower.rows[lower.pointers[upper.rows[at] + 1]++] = column;
  }
  lower.pointers.pop_back();
  return lower;
}

// The row subtree of i has a leaf at each entry whose first descendant comes after that of the previous
// entry. A leaf adds one to the counts on its path to the root. The part that two leaves share above their
// common ancestor is subtracted there.
class RowSubtrees {
 public:
  explicit RowSubtrees(std::size_t n) : newest_first_(n, kNone), newest_leaf_(n, kNone), ancestor_(n) {
    std::iota(ancestor_.begin(), ancestor_.end(), 0);
  }

  void add_entry(Index i, Index j, Index first_descendant, std::vector<Index>& counts) {
    if (first_descendant <= newest_first_[i]) return;
    newest_first_[i] = first_descendant;
    ++counts[j];
    const Index before = newest_leaf_[i];
    newest_leaf_[i] = j;
    if (before != kNone) --counts[common_ancestor(before)];
  }
  void close(Index j, Index parent) { ancestor_[j] = parent; }

 private:
  Index common_ancestor(Index leaf) {
    Index top = leaf;
    while (top != ancestor_[top]) top = ancestor_[top];
    while (leaf != top) {
      const Index next = ancestor_[leaf];
      ancestor_[leaf] = top;
      leaf = next;
    }
    return top;
  }

  std::vector<Index> newest_first_, newest_leaf_, ancestor_;
};

bool count_entries(const Pattern& upper, Checkpoint& checkpoint, const std::vector<Index>& parent,
                   std::vector<Index>& counts) {
  const Pattern lower = transposed(upper);
  const std::vector<Index> order = postorder(parent);
  std::vector<Index> first_descendant(parent.size(), kNone);
  for (Index k = 0; k < upper.size(); ++k) {
    Index j = order[k];
    counts[j] = first_descendant[j] == kNone ? 1 : 0;  // a leaf counts the diagonal entry
    for (; j != kNone && first_descendant[j] == kNone; j = parent[j]) first_descendant[j] = k;
  }
  RowSubtrees subtrees(parent.size());
  for (const Index j : order) {
    if (parent[j] != kNone) --counts[parent[j]];
    for (Index at = lower.pointers[j]; at < lower.pointers[j + 1]; ++at) {
      if (lower.rows[at] > j) subtrees.add_entry(lower.rows[at], j, first_descendant[j], counts);
    }
    if (parent[j] != kNone) subtrees.close(j, parent[j]);
    if (checkpoint.reached(1 + lower.pointers[j + 1] - lower.pointers[j])) return false;
  }
  for (const Index j : order) {
    if (parent[j] != kNone) counts[parent[j]] += counts[j];
  }
  for (Index& count : counts) --count;  // without the diagonal
  return true;
}

}  // namespace

std::vector<Index> postorder(const std::vector<Index>& parent) {
  const std::size_t n = parent.size();
  std::vector<Index> result;
  result.reserve(n);
  std::vector<Index> child(n, kNone), sibling(n, kNone), stack(n);
  for (auto j = static_cast<Index>(n) - 1; j >= 0; --j) {
    if (parent[j] == kNone) continue;
    sibling[j] = child[parent[j]];
    child[parent[j]] = j;
  }
  for (Index root = 0; root < static_cast<Index>(n); ++root) {
    if (parent[root] != kNone) continue;
    visit_postorder(root, child.data(), sibling.data(), stack.data(),
                    [&result](Index node) { result.push_back(node); });
  }
  return result;
}

bool analyse(const Pattern& upper, const Interrupt& interrupt, Elimination& out) {
  const auto n = static_cast<std::size_t>(upper.size());
  Checkpoint checkpoint(interrupt);
  out.parent.resize(n);
  out.counts.resize(n);
  if (!find_parents(upper, checkpoint, out.parent, out.counts) ||
      !count_entries(upper, checkpoint, out.parent, out.counts))
    return false;
  out.entries = out.flops = 0.0;
  for (const Index count : out.counts) {
    out.entries += count;
    out.flops += static_cast<double>(count) * (count + 2.0);
  }
  return true;
}

}  // namespace marble
