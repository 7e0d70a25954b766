// Whose turn it is: the three priorities, highest first.
#pragma once

#include <array>
#include <cstddef>

namespace marble::server {

enum class Priority { realtime, interactive, batch };
constexpr std::size_t kPriorities = 3;
constexpr std::array<const char*, kPriorities> kPriorityNames = {"realtime", "interactive", "batch"};

[[nodiscard]] constexpr const char* to_string(Priority priority) {
  return kPriorityNames[static_cast<std::size_t>(priority)];
}

}  // namespace marble::server
