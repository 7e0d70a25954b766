// Prints columns of text, as wide as needed, and formats their cells.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace marble::cli {

/// Returns text from others for this terminal, without_controls(); text longer than `longest` characters is
/// cut and ends in ….
[[nodiscard]] std::string terminal_text(std::string_view text, std::size_t longest = 1000);

/// Formats a number by a printf pattern.
[[nodiscard]] std::string formatted(const char* pattern, double value);

enum class TableFormat { text, markdown, csv };

/// Returns the format of the file's extension, .md or .csv; otherwise text.
[[nodiscard]] TableFormat table_format(const std::string& path);

class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) : rows_{std::move(header)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  /// Returns a line per row, two spaces between columns.
  [[nodiscard]] std::string text() const;
  [[nodiscard]] std::string as(TableFormat format) const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace marble::cli
