// What AMPL's auxiliary files call the rows and variables of an .nl file.
#pragma once

#include <string>
#include <vector>

namespace marble::formats {

/// Names in the file's order; fewer than there are rows or variables where they are not known.
struct NlNames {
  std::vector<std::string> rows = {};     ///< constraints, then objectives
  std::vector<std::string> columns = {};  ///< variables

  /// Of STUB.row and STUB.col, a name a line; none of what is not there.
  [[nodiscard]] static NlNames beside(const std::string& stub);

  /// "balance[3] (C7)", or "C7" where it has no name.
  [[nodiscard]] std::string row(int index) const;
  /// "x[3] (v7)", or "v7".
  [[nodiscard]] std::string column(int index) const;
};

}  // namespace marble::formats
