// Writes a problem for other solvers.
#pragma once

#include <string>

#include "marble/problem.h"

namespace marble::suite {

/// Writes a problem in the format of client/FORMATS.md, for a script that runs other solvers.
void write_json(const OwnedProblem& p, const std::string& file);

}  // namespace marble::suite
