// Reads the variables of MATLAB's files of version 4 and 5 (also written by 6 and 7) from their bytes:
// "MAT-File Format", The MathWorks. This is our own reader because libmatio trusts sizes and indices of the
// file.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "marble/error.h"
#include "parts/lcqpow_problem.h"

namespace marble::formats {

class MatFile {
 public:
  /// Finds the variables; `bytes` must outlive the result.
  [[nodiscard]] static Expected<MatFile> open(std::string_view bytes);

  /// Returns the first real matrix with that name; nothing if there is none. Indices are within the matrix,
  /// and its size is proportional to the file's (file_limits.h). The error's field is `name`.
  [[nodiscard]] Expected<std::optional<TableMatrix>> read(const std::string& name) const;

 private:
  // The position of a variable: for version 4 its header and the rest of the file, for version 5 the content
  // of its element.
  struct Place {
    std::string_view bytes;
    bool packed = false;
  };

  explicit MatFile(std::string_view bytes) : length_(bytes.size()) {}
  [[nodiscard]] Expected<void> find_version_4(std::string_view bytes);
  [[nodiscard]] Expected<void> find_version_5(std::string_view bytes);

  std::size_t length_;
  bool version_4_ = false, swapped_ = false;
  std::map<std::string, Place, std::less<>> variables_;
};

/// Returns the matrix of compressed columns, whose arrays come from a file and are checked completely. `name`
/// is the error's field.
template <class Starts, class Rows>
[[nodiscard]] Expected<TableMatrix> table_of_columns(const std::string& name, Index rows, Index columns,
                                                     const Starts& starts, const Rows& indices,
                                                     const std::vector<double>& values) {
  const auto refuse = [&](std::int64_t index, const std::string& what, const std::string& bound) {
    return unexpected(invalid(name + what, index, "", bound));
  };
  const std::size_t entries = std::min<std::size_t>(indices.size(), values.size());
  if (starts.size() <= static_cast<std::size_t>(columns))
    return refuse(-1, ".jc", "must have " + std::to_string(columns + std::int64_t{1}) + " entries");
  TableMatrix table{rows, columns};
  std::size_t next = 0;
  for (Index column = 0; column < columns; ++column) {
    const auto begin = static_cast<std::size_t>(starts[column]),
               end = static_cast<std::size_t>(starts[column + 1]);
    if (begin != next || end < begin || end > entries) {
      return refuse(column, ".jc", "must ascend from 0 to " + std::to_string(entries) + " at most");
    }
    for (; next < end; ++next) {
      const auto row = static_cast<std::int64_t>(indices[next]);
      if (row < 0 || row >= rows) {
        return refuse(static_cast<std::int64_t>(next), ".ir", "must be in [0, " + std::to_string(rows) + ")");
      }
      table.entries.add(static_cast<Index>(row), column, values[next]);
    }
  }
  return table;
}

}  // namespace marble::formats
