// Provides a line of a screen: pieces of text, each with its meaning. The screen maps meanings to colours.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace marble::cli {

enum class Style {
  plain,
  strong,
  faint,
  good,      ///< solved
  bad,       ///< an error, a disconnection
  caution,   ///< ended without being solved
  active,    ///< running
  series_1,  ///< in a plot
  series_2,
  series_3,
  series_4,
  series_5,
};
inline constexpr int kStyles = static_cast<int>(Style::series_5) + 1;

struct Span {
  std::string text;  ///< UTF-8 without control characters
  Style style = Style::plain;
};

/// Returns the columns of a terminal that the text takes. The width of a character is the locale's wcwidth.
[[nodiscard]] int columns_of(std::string_view text);

/// Returns text from others in a displayable form: no controls, no zero-width characters, and only ASCII
/// unless `unicode`; other characters become ?.
[[nodiscard]] std::string shown_text(std::string_view text, bool unicode);

/// Returns at most `width` columns of the text; cut text ends in an ellipsis.
[[nodiscard]] std::string cut_text(std::string_view text, int width, bool unicode);

class Line {
 public:
  Line() = default;
  Line(std::string text, Style style = Style::plain) { add(std::move(text), style); }  // NOLINT: implicit

  void add(std::string text, Style style = Style::plain);
  /// Appends blanks up to the column; nothing if the line is at least as long.
  void pad_to(int column);
  /// Cuts what goes beyond the width.
  void cut_to(int width);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] const std::vector<Span>& spans() const { return spans_; }
  /// Returns the text without styles.
  [[nodiscard]] std::string text() const;

  bool selected = false;  ///< shown inverted, over the whole width

 private:
  std::vector<Span> spans_;
  int width_ = 0;
};

/// A screen's content, line by line.
using Lines = std::vector<Line>;

/// Breaks text at blanks into lines of the width, at most `most` lines.
[[nodiscard]] Lines wrapped(std::string_view text, int width, std::size_t most, Style style);

void append(Lines& lines, Lines more);

struct Size {
  int width = 80, height = 24;
  bool operator==(const Size&) const = default;
};

// Determines which characters the terminal can show.

/// Sets the user's locale for characters only: number formats do not change. Returns true if it is a UTF-8
/// locale. If the requested locale is UTF-8 but not installed, as over ssh, uses C.UTF-8.
[[nodiscard]] bool set_terminal_locale();

}  // namespace marble::cli
