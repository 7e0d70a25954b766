// A line of a screen: pieces of text, each with what it means. How that looks is the screen's matter.
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
  series_1,  ///< of a plot
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

/// Columns of a terminal that the text takes. Characters count as the locale's wcwidth says.
[[nodiscard]] int columns_of(std::string_view text);

/// Text of others as it may be shown: no controls, nothing of no width, and ASCII alone unless `unicode`;
/// what cannot be shown becomes ?.
[[nodiscard]] std::string shown_text(std::string_view text, bool unicode);

/// At most `width` columns of the text; what was cut ends in an ellipsis.
[[nodiscard]] std::string cut_text(std::string_view text, int width, bool unicode);

class Line {
 public:
  Line() = default;
  Line(std::string text, Style style = Style::plain) { add(std::move(text), style); }  // NOLINT: it is one

  void add(std::string text, Style style = Style::plain);
  /// Blanks up to the column; nothing if the line is as long already.
  void pad_to(int column);
  /// Cuts what goes beyond the width.
  void cut_to(int width);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] const std::vector<Span>& spans() const { return spans_; }
  /// Without the styles.
  [[nodiscard]] std::string text() const;

  bool selected = false;  ///< shown inverted, over the whole width

 private:
  std::vector<Span> spans_;
  int width_ = 0;
};

/// A screen's content, line by line.
using Lines = std::vector<Line>;

/// Text broken at blanks into lines of the width, as many as there may be at most.
[[nodiscard]] Lines wrapped(std::string_view text, int width, std::size_t most, Style style);

void append(Lines& lines, Lines more);

struct Size {
  int width = 80, height = 24;
  bool operator==(const Size&) const = default;
};

}  // namespace marble::cli
