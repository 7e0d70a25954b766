// Provides a file's names of the variables, rows and pairs of its problem.
#pragma once

#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/problem_file.h"

namespace marble::cli {

/// Names in the problem's order; empty, or fewer than there are, if they are unknown.
struct ProblemNames {
  std::vector<std::string> variables = {}, equalities = {}, inequalities = {}, pairs = {};
};

/// Reads the key "names" of a JSON file's text, {"variables", "equalities", "inequalities", "pairs"}, each an
/// array of as many texts as the problem has. Empty without the key, or if the text is not JSON. Errors:
/// invalid_argument, fields "names", "names.pairs" and such. Memory and time are proportional to the text.
[[nodiscard]] Expected<ProblemNames> names_of_json(const std::string& text, const OwnedProblem& problem);

/// Reads the names of a JSON file as names_of_json(), or of an .nl file from the .row and .col files beside
/// it. Empty for others. Errors: as names_of_json(), and for files that cannot be read.
[[nodiscard]] Expected<ProblemNames> names_of_file(const std::string& path, const OwnedProblem& problem);

}  // namespace marble::cli
