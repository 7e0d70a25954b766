// Counts heap allocations of the whole program: link allocation_guard.cpp into a separate program.
#pragma once

#include <cstdint>

namespace marble::testing {

/// Returns the number of allocations (malloc, calloc, realloc, aligned ones, operator new) since the program
/// started, by any thread.
[[nodiscard]] std::int64_t allocations();

}  // namespace marble::testing
