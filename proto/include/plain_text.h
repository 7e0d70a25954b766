// Makes text from others, such as names in a file or messages of a server, safe for a terminal or a log.
#pragma once

#include <string>
#include <string_view>

namespace marble {

/// Removes the first character from non-empty UTF-8 and returns its bytes and its number; 0xfffd for a byte
/// that begins no character.
struct Character {
  std::string_view bytes;
  char32_t number = 0xfffd;
};
[[nodiscard]] Character take_character(std::string_view& text);

/// Returns the text with ? in place of every byte that is not UTF-8 and of every character that affects how
/// others are displayed: control characters, those that set the direction of writing, line and paragraph
/// separators, and others of no width (Unicode's Cc, Cf, Zl and Zp of 16 bits).
[[nodiscard]] std::string without_controls(std::string_view text);

/// Returns serialized JSON or TOML of one line with those characters escaped: the value is the same.
[[nodiscard]] std::string with_escaped_controls(std::string_view serialised);

}  // namespace marble
