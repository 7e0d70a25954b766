// Compares two solutions of one problem, which must be equal to the last bit.
#pragma once

#include <gtest/gtest.h>

#include "marble/solution.h"

namespace marble::testing {

inline void expect_same_bits(const Solution& there, const Solution& here) {
  EXPECT_EQ(there.status, here.status);
  EXPECT_EQ(there.z, here.z);
  EXPECT_EQ(there.equality_multipliers, here.equality_multipliers);
  EXPECT_EQ(there.inequality_multipliers, here.inequality_multipliers);
  EXPECT_EQ(there.complementarity_multipliers_L, here.complementarity_multipliers_L);
  EXPECT_EQ(there.complementarity_multipliers_R, here.complementarity_multipliers_R);
  EXPECT_EQ(there.objective, here.objective);
  EXPECT_EQ(there.factorizations, here.factorizations);
  EXPECT_EQ(there.proved, here.proved);
  EXPECT_EQ(there.bound, here.bound);
  EXPECT_EQ(there.gap, here.gap);
  EXPECT_EQ(there.nodes, here.nodes);
  EXPECT_EQ(there.open_nodes, here.open_nodes);
  EXPECT_EQ(there.reused_nodes, here.reused_nodes);
}

}  // namespace marble::testing
