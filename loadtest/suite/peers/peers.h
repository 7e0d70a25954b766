// A problem for other solvers.
#pragma once

#include <string>

#include "marble/problem.h"

namespace marble::suite {

/// A problem as client/FORMATS.md says, for a script that asks other solvers.
void write_json(const OwnedProblem& p, const std::string& file);

}  // namespace marble::suite
