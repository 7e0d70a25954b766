// Formats numbers for messages. std::to_chars takes a fifth of the time of printf, which matters in a control
// step.
#pragma once

#include <array>
#include <charconv>
#include <string>

namespace marble {

/// Returns a text that parses to the same number.
[[nodiscard]] inline std::string text_of(double value) {
  std::array<char, 32> text;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

/// Formats like printf's "%.{digits}e".
[[nodiscard]] inline std::string scientific(double value, int digits) {
  std::array<char, 32> text;
  const auto format = std::chars_format::scientific;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value, format, digits).ptr};
}

/// Formats like printf's "%.{digits}g".
[[nodiscard]] inline std::string general(double value, int digits) {
  std::array<char, 32> text;
  const auto format = std::chars_format::general;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value, format, digits).ptr};
}

}  // namespace marble
