// Text that may stand in a header or a log line as it is.
#pragma once

#include <algorithm>
#include <string_view>

namespace marble::client {

[[nodiscard]] inline bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

}  // namespace marble::client
