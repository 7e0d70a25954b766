// Reads a coupled problem from a file.
#pragma once

#include <string>
#include <vector>

#include "marble/composite/coupled.h"

namespace marble::cli {

/// The content of the file, owned.
struct CoupledFile {
  std::vector<OwnedProblem> blocks;
  std::vector<SparseMatrix> coupling;
  std::vector<double> total;

  /// A view of its arrays; this must outlive the view.
  [[nodiscard]] CoupledView view() const;
};

/// Reads {"total": [4], "blocks": [{"problem": "left.json", "coupling": {"rows": 1, "cols": 1, "i": [0], "j":
/// [0], "v": [1]}}, …]}; paths are relative to this file, in any format. Errors name the field, and the file
/// of a block that cannot be read.
[[nodiscard]] Expected<CoupledFile> read_coupled(const std::string& path);

}  // namespace marble::cli
