#include "output/text_table.h"

#include <algorithm>
#include <cstdio>

#include "plain_text.h"

namespace marble::cli {
namespace {

bool begins_character(char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }

// Counts UTF-8 characters, as the server sends them.
std::size_t characters(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), begins_character));
}

std::string replaced(std::string text, char what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
    text.replace(at, 1, by);
  return text;
}

std::string markdown_line(const std::vector<std::string>& row) {
  std::string line = "|";
  for (const std::string& cell : row) line += " " + replaced(cell, '|', "\\|") + " |";
  return line + "\n";
}

std::string csv_line(const std::vector<std::string>& row) {
  std::string line;
  for (const std::string& cell : row) {
    const bool plain = cell.find_first_of(",\"\n") == std::string::npos;
    line += (line.empty() ? "" : ",") + (plain ? cell : "\"" + replaced(cell, '"', "\"\"") + "\"");
  }
  return line + "\n";
}

}  // namespace

TableFormat table_format(const std::string& path) {
  return path.ends_with(".md")    ? TableFormat::markdown
         : path.ends_with(".csv") ? TableFormat::csv
                                  : TableFormat::text;
}

std::string terminal_text(std::string_view text, std::size_t longest) {
  const std::string shown = without_controls(text);
  if (characters(shown) <= longest) return shown;
  std::string_view rest = shown;
  for (std::size_t i = 1; i < longest; ++i) static_cast<void>(take_character(rest));
  return shown.substr(0, shown.size() - rest.size()) + "…";
}

std::string TextTable::text() const {
  std::vector<std::vector<std::string>> rows = rows_;
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (auto& row : rows) {
    for (std::string& cell : row) cell = without_controls(cell);
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], characters(row[i]));
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i)
      line += row[i] + std::string(widths[i] - characters(row[i]) + 2, ' ');
    text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  return text;
}

std::string TextTable::as(TableFormat format) const {
  if (format == TableFormat::text) return text();
  const bool markdown = format == TableFormat::markdown;
  std::string made;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    made += markdown ? markdown_line(rows_[i]) : csv_line(rows_[i]);
    if (markdown && i == 0) made += markdown_line(std::vector<std::string>(rows_[i].size(), "---"));
  }
  return made;
}

std::string formatted(const char* pattern, double value) {
  char text[48];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

}  // namespace marble::cli
