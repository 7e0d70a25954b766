// Compares two solutions of one problem, which must be equal to the last bit. Their times differ.
#pragma once

#include <gtest/gtest.h>

#include "marble/solution.h"

namespace marble::testing {

inline void expect_same_bits(const Solution& there, const Solution& here) {
#define MARBLE_SOLUTION_NUMBER(name) EXPECT_EQ(there.name, here.name);
#define MARBLE_SOLUTION_OPTIONAL(name) EXPECT_EQ(there.name, here.name);
#define MARBLE_SOLUTION_TEXT(name) EXPECT_EQ(there.name, here.name);
#define MARBLE_SOLUTION_VECTOR(name, ...) EXPECT_EQ(there.name, here.name);
#define MARBLE_SOLUTION_ENUM(name) EXPECT_EQ(there.name, here.name);
#include "marble/solution.def"
}

}  // namespace marble::testing
