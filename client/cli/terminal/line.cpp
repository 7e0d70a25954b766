#include "terminal/line.h"

#include <wchar.h>

#include <algorithm>

namespace marble::cli {
namespace {

struct Character {
  std::string_view bytes;
  wchar_t code = 0;
};

std::size_t length_of(unsigned char first) {
  if (first < 0x80) return 1;
  if (first >= 0xc2 && first < 0xe0) return 2;
  if (first >= 0xe0 && first < 0xf0) return 3;
  return first >= 0xf0 && first < 0xf5 ? 4 : 0;
}

// The first character of UTF-8. A byte that begins none is one of code 0.
Character first_of(std::string_view text) {
  const auto first = static_cast<unsigned char>(text.front());
  const std::size_t length = length_of(first);
  if (length == 0 || length > text.size()) return {text.substr(0, 1)};
  if (length == 1) return {text.substr(0, 1), static_cast<wchar_t>(first)};
  unsigned code = first & (0xffU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if ((byte & 0xc0) != 0x80) return {text.substr(0, 1)};
    code = (code << 6) | (byte & 0x3fU);
  }
  return {text.substr(0, length), static_cast<wchar_t>(code)};
}

int columns_of(const Character& character) { return std::max(0, ::wcwidth(character.code)); }

// Bytes of what goes on one line: up to a blank, or all that fits of a word that is longer, but something.
std::size_t length_of_line(std::string_view text, int width) {
  std::size_t length = 0, blank = 0;
  for (int columns = 0; length < text.size();) {
    const Character next = first_of(text.substr(length));
    columns += columns_of(next);
    if (columns > width && length > 0) return next.bytes == " " || blank == 0 ? length : blank;
    if (next.bytes == " ") blank = length;
    length += next.bytes.size();
  }
  return length;
}

}  // namespace

int columns_of(std::string_view text) {
  int columns = 0;
  while (!text.empty()) {
    const Character next = first_of(text);
    columns += columns_of(next);
    text.remove_prefix(next.bytes.size());
  }
  return columns;
}

std::string shown_text(std::string_view text, bool unicode) {
  std::string shown;
  while (!text.empty()) {
    const Character next = first_of(text);
    const bool fits = next.code < 0x80 || unicode;
    if (fits && next.code != 0 && columns_of(next) > 0) {
      shown += next.bytes;
    } else {
      shown += '?';
    }
    text.remove_prefix(next.bytes.size());
  }
  return shown;
}

std::string cut_text(std::string_view text, int width, bool unicode) {
  if (columns_of(text) <= width) return std::string(text);
  if (width <= 0) return "";
  std::string cut;
  int columns = 1;  // of the ellipsis
  while (!text.empty()) {
    const Character next = first_of(text);
    columns += columns_of(next);
    if (columns > width) break;
    cut += next.bytes;
    text.remove_prefix(next.bytes.size());
  }
  return cut + (unicode ? "…" : "~");
}

void Line::add(std::string text, Style style) {
  width_ += columns_of(text);
  if (!spans_.empty() && spans_.back().style == style) {
    spans_.back().text += text;
  } else if (!text.empty()) {
    spans_.push_back({std::move(text), style});
  }
}

void Line::pad_to(int column) {
  if (column > width_) add(std::string(static_cast<std::size_t>(column - width_), ' '));
}

void Line::cut_to(int width) {
  if (width_ <= width) return;
  int left = std::max(0, width);
  std::vector<Span> kept;
  for (Span& span : spans_) {
    std::string_view rest = span.text;
    std::string part;
    while (!rest.empty()) {
      const Character next = first_of(rest);
      if (columns_of(next) > left) break;
      left -= columns_of(next);
      part += next.bytes;
      rest.remove_prefix(next.bytes.size());
    }
    const bool cut = !rest.empty();
    if (!part.empty()) kept.push_back({std::move(part), span.style});
    if (cut) break;
  }
  spans_ = std::move(kept);
  width_ = columns_of(text());
}

std::string Line::text() const {
  std::string text;
  for (const Span& span : spans_) text += span.text;
  return text;
}

Lines wrapped(std::string_view text, int width, std::size_t most, Style style) {
  Lines lines;
  while (!text.empty() && lines.size() < most) {
    const std::size_t length = length_of_line(text, width);
    lines.emplace_back(std::string(text.substr(0, length)), style);
    text.remove_prefix(length);
    text.remove_prefix(std::min(text.size(), text.find_first_not_of(' ')));
  }
  return lines;
}

void append(Lines& lines, Lines more) {
  for (Line& line : more) lines.push_back(std::move(line));
}

}  // namespace marble::cli
