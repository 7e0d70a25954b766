// Walks through trees given by each node's first child and next sibling, -1 where there is none.
#pragma once

#include "marble/problem.h"

namespace marble {

/// Visits every node of a tree after its children, and empties `first_child` on the way. `stack` has room for
/// all nodes.
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

}  // namespace marble
