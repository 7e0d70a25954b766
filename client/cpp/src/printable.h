// Checks that text may stand unchanged in a header or a log line.
#pragma once

#include <algorithm>
#include <string_view>

namespace marble::client {

[[nodiscard]] inline bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

}  // namespace marble::client
