// How an answer changes with its problem, for people and for programs.
#pragma once

#include <string>

#include "marble/solution.h"
#include "output/json.h"

namespace marble::cli {

/// What of an answer's derivatives fits one line; empty where none were asked for.
[[nodiscard]] std::string sensitivity_text(const Solution& answer);
/// All of them: an object; null where none were asked for.
[[nodiscard]] Json sensitivity_json(const Solution& answer);

}  // namespace marble::cli
