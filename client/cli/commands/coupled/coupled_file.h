// Problems that rows tie together, as a file.
#pragma once

#include <string>
#include <vector>

#include "marble/composite/coupled.h"

namespace marble::cli {

/// What was read, owned.
struct CoupledFile {
  std::vector<OwnedProblem> blocks;
  std::vector<SparseMatrix> coupling;
  std::vector<double> total;

  /// Of its arrays; it must outlive the view.
  [[nodiscard]] CoupledView view() const;
};

/// {"total": [4], "blocks": [{"problem": "left.json", "coupling": {"rows": 1, "cols": 1, "i": [0], "j": [0],
/// "v": [1]}}, …]}; files are found from where this one is, in any format. Errors name the field, and the
/// file of a block that cannot be read.
[[nodiscard]] Expected<CoupledFile> read_coupled(const std::string& path);

}  // namespace marble::cli
