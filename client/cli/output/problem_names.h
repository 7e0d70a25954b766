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

  [[nodiscard]] bool empty() const {
    return variables.empty() && equalities.empty() && inequalities.empty() && pairs.empty();
  }
};

/// Reads the key "names" of a JSON file's text, {"variables", "equalities", "inequalities", "pairs"}, each an
/// array of as many texts as the problem has. Empty without the key, or if the text is not JSON. Errors:
/// invalid_argument, fields "names" (no object, or nested deeper than 64), "names.pairs" and such. Memory and
/// time are proportional to the text.
[[nodiscard]] Expected<ProblemNames> names_of_json(const std::string& text, const OwnedProblem& problem);

/// Reads the names of a JSON file as names_of_json(), or of an .nl file from the .row and .col files beside
/// it. Empty for others. Errors: as names_of_json(), and for files that cannot be read.
[[nodiscard]] Expected<ProblemNames> names_of_file(const std::string& path, const OwnedProblem& problem);

/// A problem with its names.
struct NamedProblem {
  ProblemFile file;
  ProblemNames names;
};
/// Reads a problem as formats::read_any_problem() and its names as names_of_file(); "-" is standard input.
[[nodiscard]] Expected<NamedProblem> read_named_problem(const std::string& path);
/// Adds the key "names" to the JSON text of a problem, as write_problem() writes it, if there are names.
/// Bytes that are not UTF-8, which the names of an .nl file may contain, are replaced.
[[nodiscard]] std::string with_names(std::string problem, const ProblemNames& names);

}  // namespace marble::cli
