// Clauses: sets of pairs whose weak sides cannot all be zero, so that one pair must have its strong side at
// zero.
//
// Fixing the weak side of a pair gains nothing, so branching on single pairs leads nowhere. Branching on a
// whole clause leaves no child without a gain. (Clauses come from sums of switches that must be 1: a gate
// must be passed at some step. They are like the sets of Beale and Forrest, "Global optimization using
// special ordered sets", 1976, but found from the rows that contradict each other.)
#pragma once

#include <vector>

#include "global/node.h"
#include "global/pseudo_costs.h"

namespace marble {

struct Clause {
  struct Member {
    Index pair;
    bool strong_s;  ///< whether s is its strong side
  };
  std::vector<Member> members;
  Vector contradiction = {};  ///< multipliers that prove that not all weak sides can be zero
  std::shared_ptr<const LeafMultipliers> record = {};  ///< the whole proof, if a caller requests it

  /// Returns the members whose strong side may still be at zero; empty if one has it already.
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
