// Columns of text, as wide as they need to be, and what their cells hold.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace marble::cli {

/// Text of others on this terminal, without_controls(); what is longer than `longest` characters is cut and
/// ends in ….
[[nodiscard]] std::string terminal_text(std::string_view text, std::size_t longest = 1000);

/// A number as a pattern of printf says.
[[nodiscard]] std::string formatted(const char* pattern, double value);

enum class TableFormat { text, markdown, csv };

/// By the end of the file's name, .md or .csv; text else.
[[nodiscard]] TableFormat table_format(const std::string& path);

class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) : rows_{std::move(header)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  /// A line a row, two spaces between columns.
  [[nodiscard]] std::string text() const;
  [[nodiscard]] std::string as(TableFormat format) const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace marble::cli
