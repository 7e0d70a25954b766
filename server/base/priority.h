// The three priorities of jobs, highest first.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace marble::server {

enum class Priority { realtime, interactive, batch };
constexpr std::size_t kPriorities = 3;
constexpr std::array<const char*, kPriorities> kPriorityNames = {"realtime", "interactive", "batch"};

/// Returns the nearest class, because stored numbers may have any value.
[[nodiscard]] constexpr Priority priority_of(std::int64_t number) {
  return static_cast<Priority>(std::clamp<std::int64_t>(number, 0, kPriorities - 1));
}

[[nodiscard]] constexpr const char* to_string(Priority priority) {
  return kPriorityNames[static_cast<std::size_t>(priority)];
}

}  // namespace marble::server
