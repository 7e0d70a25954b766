// Reports a solution's derivatives, for people and for programs.
#pragma once

#include <string>

#include "marble/solution.h"
#include "output/json.h"

namespace marble::cli {

/// Returns a one-line summary of a solution's derivatives; empty if none were requested.
[[nodiscard]] std::string sensitivity_text(const Solution& answer);
/// Returns all derivatives as an object; null if none were requested.
[[nodiscard]] Json sensitivity_json(const Solution& answer);

}  // namespace marble::cli
