// Reads a request for derivatives of a solution from a file.
#pragma once

#include <string>

#include "marble/sensitivity.h"
#include "output/json.h"

namespace marble::cli {

/// Parses the file. Errors: not_found, invalid_argument of field "--sensitivity".
[[nodiscard]] Expected<Json> read_sensitivity(const std::string& path);
/// Returns the request for a problem. Errors: invalid_argument, of fields such as
/// "sensitivity.directions[0].b".
[[nodiscard]] Expected<OwnedSensitivityRequest> sensitivity_of(const Json& json, const OwnedProblem& problem);

}  // namespace marble::cli
