// Provides names of enumerators by their numbers.
#pragma once

#include <cstddef>

namespace marble::client {

template <class Enumeration, std::size_t count>
[[nodiscard]] const char* name_of(Enumeration value, const char* const (&names)[count]) {
  const auto number = static_cast<std::size_t>(value);
  return number < count ? names[number] : "unknown";
}

}  // namespace marble::client
