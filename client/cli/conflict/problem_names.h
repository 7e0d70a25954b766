// What a file calls the variables, rows and pairs of its problem.
#pragma once

#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/problem_file.h"

namespace marble::cli {

/// Names in the problem's order; empty, or fewer than there are, where they are not known.
struct ProblemNames {
  std::vector<std::string> variables = {}, equalities = {}, inequalities = {}, pairs = {};
};

/// Of a JSON file those of its key "names", {"variables", "equalities", "inequalities", "pairs"}, each an
/// array of as many texts as there are; of an .nl file those of the .row and .col files beside it. None of
/// others. Errors: invalid_argument, fields "names", "names.pairs" and such.
[[nodiscard]] Expected<ProblemNames> names_of_file(const std::string& path, const OwnedProblem& problem);

}  // namespace marble::cli
