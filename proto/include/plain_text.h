// Text of others, such as names in a file or messages of a server, as it may go to a terminal or a log.
#pragma once

#include <string>
#include <string_view>

namespace marble {

/// Takes the first character off UTF-8 that is not empty: its bytes, and its number; of a byte that begins
/// none, 0xfffd.
struct Character {
  std::string_view bytes;
  char32_t number = 0xfffd;
};
[[nodiscard]] Character take_character(std::string_view& text);

/// The text with ? in place of every byte that is no UTF-8 and of every character that steers how others are
/// shown: control characters, those that set the direction of writing, line and paragraph separators, and
/// others of no width (Unicode's Cc, Cf, Zl and Zp of 16 bits).
[[nodiscard]] std::string without_controls(std::string_view text);

/// Serialised JSON or TOML of one line with those characters escaped: the value is the same.
[[nodiscard]] std::string with_escaped_controls(std::string_view serialised);

}  // namespace marble
