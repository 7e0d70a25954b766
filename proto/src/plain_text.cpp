#include "plain_text.h"

#include <algorithm>
#include <cstdio>
#include <iterator>

namespace marble {
namespace {

struct Range {
  char32_t first, last;
};

// Those of 16 bits: no others affect the text around them.
constexpr Range kControls[] = {
    {0x00, 0x1f},     {0x7f, 0x9f},     {0xad, 0xad},     {0x61c, 0x61c},   {0x180e, 0x180e},
    {0x200b, 0x200f}, {0x2028, 0x202e}, {0x2060, 0x206f}, {0xfeff, 0xfeff}, {0xfff9, 0xfffb},
};

bool is_control(char32_t character) {
  return std::any_of(std::begin(kControls), std::end(kControls), [character](const Range& range) {
    return character >= range.first && character <= range.last;
  });
}

// Returns the number of bytes of a character by its first byte; 0 if it begins none.
std::size_t length_of(unsigned char first) {
  if (first < 0x80) return 1;
  if (first >= 0xc2 && first < 0xe0) return 2;
  if (first >= 0xe0 && first < 0xf0) return 3;
  return first >= 0xf0 && first < 0xf5 ? 4 : 0;
}

// Overlong forms, surrogates and numbers beyond the last are no characters.
bool is_character(char32_t number, std::size_t length) {
  constexpr char32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  return number >= kLeast[length] && number <= 0x10ffff && (number < 0xd800 || number > 0xdfff);
}

Character first_of(std::string_view text) {
  const auto first = static_cast<unsigned char>(text.front());
  const std::size_t length = length_of(first);
  if (length == 0 || length > text.size()) return {text.substr(0, 1)};
  if (length == 1) return {text.substr(0, 1), first};
  char32_t number = first & (0xffU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if ((byte & 0xc0) != 0x80) return {text.substr(0, 1)};
    number = (number << 6) | (byte & 0x3fU);
  }
  if (!is_character(number, length)) return {text.substr(0, 1)};
  return {text.substr(0, length), number};
}

constexpr char32_t kNone = Character().number;

std::string escaped(char32_t number) {
  char text[16];
  std::snprintf(text, sizeof text, "\\u%04x", static_cast<unsigned>(number));
  return text;
}

bool is_plain(char c) { return c >= ' ' && c <= '~'; }

template <class Replace>
std::string replaced(std::string_view text, const Replace& replace) {
  if (std::all_of(text.begin(), text.end(), is_plain)) return std::string(text);
  std::string shown;
  shown.reserve(text.size());
  while (!text.empty()) {
    const Character next = take_character(text);
    const bool bad = (next.number == kNone && next.bytes.size() == 1) || is_control(next.number);
    if (bad) {
      shown += replace(next.number);
    } else {
      shown += next.bytes;
    }
  }
  return shown;
}

}  // namespace

Character take_character(std::string_view& text) {
  const Character next = first_of(text);
  text.remove_prefix(next.bytes.size());
  return next;
}

std::string without_controls(std::string_view text) {
  return replaced(text, [](char32_t) { return "?"; });
}

std::string with_escaped_controls(std::string_view serialised) { return replaced(serialised, escaped); }

}  // namespace marble
