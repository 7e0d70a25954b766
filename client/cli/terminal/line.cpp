#include "terminal/line.h"

#include <langinfo.h>
#include <wchar.h>

#include <algorithm>
#include <clocale>
#include <cstdlib>
#include <cstring>
#include <string>

#include "plain_text.h"

namespace marble::cli {
namespace {

int columns_of(const Character& character) {
  return std::max(0, ::wcwidth(static_cast<wchar_t>(character.number)));
}

// Returns the bytes for one line: up to a blank, or all that fits of a longer word, but at least one
// character.
std::size_t length_of_line(std::string_view text, int width) {
  std::size_t length = 0, blank = 0;
  for (int columns = 0; length < text.size();) {
    std::string_view rest = text.substr(length);
    const Character next = take_character(rest);
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
  while (!text.empty()) columns += columns_of(take_character(text));
  return columns;
}

std::string shown_text(std::string_view text, bool unicode) {
  const std::string plain = without_controls(text);
  std::string shown;
  for (std::string_view rest = plain; !rest.empty();) {
    const Character next = take_character(rest);
    const bool fits = next.number < 0x80 || unicode;
    if (fits && columns_of(next) > 0) {
      shown += next.bytes;
    } else {
      shown += '?';
    }
  }
  return shown;
}

std::string cut_text(std::string_view text, int width, bool unicode) {
  if (columns_of(text) <= width) return std::string(text);
  if (width <= 0) return "";
  std::string cut;
  int columns = 1;  // of the ellipsis
  while (!text.empty()) {
    const Character next = take_character(text);
    columns += columns_of(next);
    if (columns > width) break;
    cut += next.bytes;
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
    bool cut = false;
    while (!rest.empty()) {
      const Character next = take_character(rest);
      cut = columns_of(next) > left;
      if (cut) break;
      left -= columns_of(next);
      part += next.bytes;
    }
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

namespace {

bool names_utf8(const char* locale) {
  return strcasestr(locale, "utf-8") != nullptr || strcasestr(locale, "utf8") != nullptr;
}

const char* asked_for() {
  for (const char* variable : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char* value = std::getenv(variable);
    if (value != nullptr && *value != '\0') return value;
  }
  return "";
}

}  // namespace

bool set_terminal_locale() {
  if (std::setlocale(LC_CTYPE, "") == nullptr && names_utf8(asked_for())) std::setlocale(LC_CTYPE, "C.UTF-8");
  return std::strcmp(nl_langinfo(CODESET), "UTF-8") == 0;
}

}  // namespace marble::cli
