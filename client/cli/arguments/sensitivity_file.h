// What is asked of an answer's derivatives, as a file says it.
#pragma once

#include <string>

#include "marble/sensitivity.h"
#include "output/json.h"

namespace marble::cli {

/// Parses the file. Errors: not_found, invalid_argument of field "--sensitivity".
[[nodiscard]] Expected<Json> read_sensitivity(const std::string& path);
/// What it asks of a problem. Errors: invalid_argument, of fields like "sensitivity.directions[0].b".
[[nodiscard]] Expected<OwnedSensitivityRequest> sensitivity_of(const Json& json, const OwnedProblem& problem);

}  // namespace marble::cli
