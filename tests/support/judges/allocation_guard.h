// Counts heap allocations of the whole program: link allocation_guard.cpp into a program of its own.
#pragma once

#include <cstdint>

namespace marble::testing {

/// Allocations (malloc, calloc, realloc, aligned ones, operator new) since the program began, by any thread.
[[nodiscard]] std::int64_t allocations();

}  // namespace marble::testing
