// Clauses: sets of pairs that cannot all have their weak side at zero, so that one of them has its strong one
// there.
//
// Fixing the weak side of a pair gains nothing, so that branching pair by pair leads nowhere; branching on a
// whole clause leaves no child without a gain. (Sums of switches that must be 1 bring them forth: a gate must
// be passed at some step. As the sets of Beale and Forrest, "Global optimization using special ordered sets",
// 1976, but found by the rows that contradict each other.)
#pragma once

#include <vector>

#include "tree/node.h"
#include "tree/pseudo_costs.h"

namespace marble {

struct Clause {
  struct Member {
    Index pair;
    bool strong_s;  ///< whether s is its strong side
  };
  std::vector<Member> members;
  Vector contradiction = {};  ///< multipliers of the rows: all weak sides at zero contradict each other
  std::shared_ptr<const LeafMultipliers> record = {};  ///< the whole of it, if a caller asks for it

  /// Those that may still have their strong side at zero; empty if one has already.
  [[nodiscard]] std::vector<Member> open(const Fixings& fixings) const {
    std::vector<Member> result;
    for (const Member& member : members) {
      const Sides sides = fixings[static_cast<std::size_t>(member.pair)];
      if (sides == Sides::relaxed) {
        result.push_back(member);
      } else if (sides != (member.strong_s ? Sides::t_zero : Sides::s_zero)) {
        return {};
      }
    }
    return result;
  }
};

}  // namespace marble
