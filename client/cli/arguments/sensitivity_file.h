// What is asked of an answer's derivatives, as a file says it.
#pragma once

#include <string>
#include <vector>

#include "marble/sensitivity.h"
#include "output/json.h"

namespace marble::cli {

/// A request of one problem, with its arrays.
struct OwnedSensitivityRequest {
  Index directions = 0, losses = 0;
  OwnedProblem numbers;  ///< of the directions: its vectors, and the values of its matrices
  std::vector<double> z, equality_multipliers, inequality_multipliers, complementarity_multipliers_L,
      complementarity_multipliers_R;  ///< of the losses
  SparseMatrix E;                     ///< without rows where none are asked for
  std::vector<double> proximal, g;
  bool columns = false;

  /// Borrows its arrays.
  [[nodiscard]] SensitivityRequest view() const;
};

/// Parses the file. Errors: not_found, invalid_argument of field "--sensitivity".
[[nodiscard]] Expected<Json> read_sensitivity(const std::string& path);
/// What it asks of a problem. Errors: invalid_argument, of fields like "sensitivity.directions[0].b".
[[nodiscard]] Expected<OwnedSensitivityRequest> sensitivity_of(const Json& json, const OwnedProblem& problem);

}  // namespace marble::cli
