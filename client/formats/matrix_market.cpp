#include "matrix_market.h"

#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "file_bytes.h"
#include "tables.h"

namespace marble::formats {
namespace {

constexpr const char* kParts[] = {"Q", "g", "A", "b", "C", "d", "L", "l", "R", "r", "c0", "x0"};
constexpr std::size_t kMost = 0x7fffffff;

/// The content of the first line: %%MatrixMarket matrix coordinate real general, and its variants.
struct Banner {
  bool coordinate = false, symmetric = false, skew = false;
};

class Reader {
 public:
  // Accepts at most `most` rows and columns.
  Reader(std::string_view content, std::string part, std::int64_t most)
      : rest_(content), part_(std::move(part)), most_(most) {}

  Expected<TableMatrix> read() {
    MARBLE_ASSIGN_OR_RETURN(const auto banner, read_banner());
    skip_comments();
    const std::int64_t rows = integer(0, most_), columns = integer(0, most_);
    TableMatrix table{static_cast<Index>(rows), static_cast<Index>(columns)};
    if (banner.coordinate) {
      for (std::int64_t left = integer(0, kMost); left > 0 && !failed_; --left) {
        const auto row = static_cast<Index>(integer(1, rows) - 1);
        const auto column = static_cast<Index>(integer(1, columns) - 1);
        add(table, banner, row, column, real());
      }
    } else {
      for (Index column = 0; column < table.columns && !failed_; ++column) {
        const Index first = banner.skew ? column + 1 : banner.symmetric ? column : 0;
        for (Index row = first; row < table.rows && !failed_; ++row) {
          if (const double value = real(); value != 0.0) add(table, banner, row, column, value);
        }
      }
    }
    if (failed_) return unexpected(fault("line " + std::to_string(line_), rule_));
    return table;
  }

 private:
  [[nodiscard]] Error fault(const std::string& value, const std::string& bound) const {
    return invalid(part_, value, bound);
  }
  void fail(const std::string& rule) {
    if (!failed_) rule_ = rule;
    failed_ = true;
  }

  std::string_view take_line() {
    ++line_;
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    const std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    return line;
  }

  Expected<Banner> read_banner() {
    std::string text(take_line());
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    std::istringstream words(text);
    std::string magic, object, format, field, symmetry;
    words >> magic >> object >> format >> field >> symmetry;
    if (magic != "%%matrixmarket" || object != "matrix" || (format != "coordinate" && format != "array"))
      return unexpected(fault("", "is no Matrix Market file of a matrix"));
    if (field != "real" && field != "double" && field != "integer")
      return unexpected(fault(field, "must be real or integer"));
    if (symmetry != "general" && symmetry != "symmetric" && symmetry != "skew-symmetric")
      return unexpected(fault(symmetry, "must be general, symmetric or skew-symmetric"));
    return Banner{format == "coordinate", symmetry != "general", symmetry == "skew-symmetric"};
  }

  void skip_comments() {
    while (!rest_.empty() && (rest_.front() == '%' || rest_.front() == '\n' || rest_.front() == '\r'))
      static_cast<void>(take_line());
  }

  template <class Number>
  Number number(const char* rule) {
    while (!rest_.empty() && std::isspace(static_cast<unsigned char>(rest_.front())) != 0) {
      if (rest_.front() == '\n') ++line_;
      rest_.remove_prefix(1);
    }
    if (!rest_.empty() && rest_.front() == '+') rest_.remove_prefix(1);
    Number value = 0;
    const auto [end, code] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (code != std::errc()) {
      fail(rest_.empty() ? "ends too soon" : rule);
      return 0;
    }
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    return value;
  }
  std::int64_t integer(std::int64_t low, std::int64_t high) {
    const auto value = failed_ ? low : number<std::int64_t>("must hold an integer");
    if (failed_ || (value >= low && value <= high)) return value;
    fail("must hold an integer in [" + std::to_string(low) + ", " + std::to_string(high) + "]");
    return low;
  }
  double real() { return failed_ ? 0.0 : number<double>("must hold a number"); }

  // Adds an entry, and the implied one of the other triangle.
  void add(TableMatrix& table, const Banner& banner, Index row, Index column, double value) {
    if (failed_) return;
    if (banner.symmetric && table.rows != table.columns) return fail("must be square: it is symmetric");
    table.entries.add(row, column, value);
    if (banner.symmetric && row != column) table.entries.add(column, row, banner.skew ? -value : value);
  }

  std::string_view rest_;
  const std::string part_;
  const std::int64_t most_;
  int line_ = 1;
  bool failed_ = false;
  std::string rule_;
};

std::string path_of(const std::string& folder, const char* part) {
  return (std::filesystem::path(folder) / part).string() + ".mtx";
}

// Appends the shortest text that keeps every bit.
void append(std::string& text, double value) {
  std::array<char, 32> digits;
  text.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
}

std::string text_of(const SparseMatrix& matrix) {
  std::string text = "%%MatrixMarket matrix coordinate real general\n" + std::to_string(matrix.rows) + " " +
                     std::to_string(matrix.columns) + " " + std::to_string(matrix.values.size()) + "\n";
  for (Index column = 0; column < matrix.columns; ++column) {
    const auto begin = static_cast<std::size_t>(matrix.column_pointers[static_cast<std::size_t>(column)]);
    const auto end = static_cast<std::size_t>(matrix.column_pointers[static_cast<std::size_t>(column) + 1]);
    for (std::size_t k = begin; k < end; ++k) {
      text += std::to_string(matrix.row_indices[k] + 1) + " " + std::to_string(column + 1) + " ";
      append(text, matrix.values[k]);
      text += "\n";
    }
  }
  return text;
}

std::string text_of(const std::vector<double>& vector) {
  std::string text = "%%MatrixMarket matrix array real general\n" + std::to_string(vector.size()) + " 1\n";
  for (const double value : vector) {
    append(text, value);
    text += "\n";
  }
  return text;
}

Expected<void> write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (file) return {};
  return unexpected(failure(ErrorCode::unavailable, "", path, "cannot be written"));
}

}  // namespace

Expected<ProblemFile> parse_matrix_market(const MatrixMarketParts& parts, const std::string& name) {
  std::size_t length = 0;
  for (const auto& [part, content] : parts) length += content.size();
  const auto most = static_cast<std::int64_t>(std::min(most_rows(length), kMost));
  const auto read = [&](const char* part) -> Expected<std::optional<TableMatrix>> {
    const auto found = parts.find(part);
    if (found == parts.end()) return std::nullopt;
    MARBLE_ASSIGN_OR_RETURN(auto table, Reader(found->second, part, most).read());
    return table;
  };
  return assemble_tables(read, name);
}

Expected<ProblemFile> read_matrix_market(const std::string& folder, const std::string& name) {
  MatrixMarketParts parts;
  for (const char* part : kParts) {
    std::error_code unknown;
    const std::string path = path_of(folder, part);
    if (!std::filesystem::exists(path, unknown)) continue;
    auto content = read_bytes(path);
    if (!content) return unexpected(of_field(part, content.error()));
    parts.emplace(part, std::move(*content));
  }
  return parse_matrix_market(parts, name);
}

Expected<void> write_matrix_market(const ProblemFile& file, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) {
    return unexpected(failure(ErrorCode::unavailable, "", folder, "cannot be made: " + failed.message()));
  }
  for (const char* part : kParts) std::filesystem::remove(path_of(folder, part), failed);
  TableSink sink;
  sink.matrix = [&](const char* part, const SparseMatrix& matrix) {
    return write_file(path_of(folder, part), text_of(matrix));
  };
  sink.vector = [&](const char* part, const std::vector<double>& vector) {
    return write_file(path_of(folder, part), text_of(vector));
  };
  return write_tables(file, sink);
}

}  // namespace marble::formats
