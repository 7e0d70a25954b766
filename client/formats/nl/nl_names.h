// Reads the names of rows and variables from the auxiliary files of an .nl file.
#pragma once

#include <string>
#include <vector>

namespace marble::formats {

/// Names in the file's order; fewer than rows or variables if they are unknown.
struct NlNames {
  std::vector<std::string> rows = {};     ///< constraints, then objectives
  std::vector<std::string> columns = {};  ///< variables

  /// Reads STUB.row and STUB.col, a name per line; a missing file gives no names.
  [[nodiscard]] static NlNames beside(const std::string& stub);

  /// Returns "balance[3] (C7)", or "C7" without a name.
  [[nodiscard]] std::string row(int index) const;
  /// Returns "x[3] (v7)", or "v7".
  [[nodiscard]] std::string column(int index) const;
};

}  // namespace marble::formats
