#include "output/trace_file.h"

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iostream>
#include <limits>
#include <sstream>

#include "marble/progress.h"
#include "output/text_table.h"

namespace marble::cli {
namespace {

constexpr std::size_t kLongestValue = 40;  // of quoted text in an error

Error fault(std::size_t line, std::string_view column, std::string_view value, std::string rule) {
  std::string field = "line " + std::to_string(line);
  if (!column.empty()) field += ", column " + std::string(column);
  return invalid(std::move(field), value.empty() ? "" : "\"" + terminal_text(value, kLongestValue) + "\"",
                 std::move(rule));
}

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (;;) {
    const std::size_t comma = line.find(',');
    cells.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

// Removes a line from the text and returns it without its end.
std::string_view take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

Expected<void> check_width(std::size_t line, std::size_t cells, std::size_t columns) {
  if (cells == columns) return {};
  return unexpected(
      fault(line, "", "", "has " + std::to_string(cells) + " columns: must have " + std::to_string(columns)));
}

// Returns the number of columns: all, or those of the format before trees.
Expected<std::size_t> columns_of_header(std::string_view line) {
  const auto cells = cells_of(line);
  for (std::size_t i = 0; i < std::min(cells.size(), progress_columns().size()); ++i) {
    const std::string name(progress_columns()[i].name);
    if (cells[i] != name)
      return unexpected(fault(1, std::to_string(i + 1), cells[i], "is no trace: must be " + name));
  }
  if (cells.size() == kColumnsBeforeTrees) return cells.size();
  MARBLE_RETURN_IF_ERROR(check_width(1, cells.size(), progress_columns().size()));
  return cells.size();
}

Expected<double> number_in(std::string_view text, const ProgressColumn& column, std::size_t line) {
  double value = 0.0;
  const char* const end = text.data() + text.size();
  const auto [stop, status] = std::from_chars(text.data(), end, value);
  if (status == std::errc::result_out_of_range &&
      stop == end) {  // denormal or beyond: what strtod makes of it
    value = std::strtod(std::string(text).c_str(), nullptr);
  } else if (status != std::errc() || stop != end) {
    return unexpected(fault(line, column.name, text, "must be a number"));
  }
  constexpr double kMost = std::numeric_limits<std::int32_t>::max();
  if (column.integer && !(value >= 0.0 && value <= kMost && value == std::floor(value)))
    return unexpected(fault(line, column.name, text, "must be an integer in [0, 2147483647]"));
  return value;
}

Expected<Progress> row_of(std::string_view text, std::size_t line, std::size_t columns) {
  const auto cells = cells_of(text);
  MARBLE_RETURN_IF_ERROR(check_width(line, cells.size(), columns));
  Progress row;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const ProgressColumn& column = progress_columns()[i];
    MARBLE_ASSIGN_OR_RETURN(const auto value, number_in(cells[i], column, line));
    column.set(row, value);
  }
  return row;
}

}  // namespace

TraceWriter::TraceWriter(AtomicFile file) : file_(std::move(file)) {
  file_.write(progress_csv_header() + "\n");
}

Expected<TraceWriter> TraceWriter::open(const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(auto file, AtomicFile::open(path));
  return TraceWriter(std::move(file));
}

void TraceWriter::report(const Progress& row) {
  line_.clear();
  append_progress_csv(row, line_);
  line_ += '\n';
  file_.write(line_);
  ++rows_;
}

Expected<std::vector<Progress>> parse_trace(std::string_view text) {
  MARBLE_ASSIGN_OR_RETURN(const auto columns, columns_of_header(take_line(text)));
  std::vector<Progress> rows;
  for (std::size_t line = 2; !text.empty(); ++line) {
    const std::string_view next = take_line(text);
    if (next.empty() && text.empty()) break;
    MARBLE_ASSIGN_OR_RETURN(auto row, row_of(next, line, columns));
    rows.push_back(row);
  }
  if (rows.empty()) return unexpected(fault(2, "", "", "has no row: nothing to plot"));
  return rows;
}

Expected<std::vector<Progress>> read_trace(const std::string& path) {
  std::ostringstream text;
  if (path == "-") {
    text << std::cin.rdbuf();
    return parse_trace(text.str());
  }
  std::ifstream file(path, std::ios::binary);
  if (file.is_open()) text << file.rdbuf();
  if (!file.is_open() || file.bad()) {
    return unexpected(failure(ErrorCode::not_found, std::string("cannot be read: ") + std::strerror(errno)));
  }
  return parse_trace(text.str());
}

}  // namespace marble::cli
