// Prepares text for a message.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

#include "marble/contract.h"

namespace marble::client {

/// Returns at most `longest` bytes of `text`, cut between characters, with ? for every byte that is not
/// UTF-8: a message with such a byte cannot be parsed, and file names may contain any.
[[nodiscard]] std::string message_text(std::string_view text, std::size_t longest);

// Checks that text may stand unchanged in a header or a log line.
[[nodiscard]] inline bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

// Provides names of enumerators by their numbers.
template <class Enumeration, std::size_t count>
[[nodiscard]] const char* name_of(Enumeration value, const char* const (&names)[count]) {
  const auto number = static_cast<std::size_t>(value);
  return number < count ? names[number] : "unknown";
}

}  // namespace marble::client
