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

  [[nodiscard]] bool empty() const {
    return variables.empty() && equalities.empty() && inequalities.empty() && pairs.empty();
  }
};

/// Of the text of a JSON file: its key "names", {"variables", "equalities", "inequalities", "pairs"}, each an
/// array of as many texts as the problem has. None without the key, or if it is no JSON. Errors:
/// invalid_argument, fields "names" (no object, or nested deeper than 64), "names.pairs" and such. Memory and
/// time are in proportion to the text.
[[nodiscard]] Expected<ProblemNames> names_of_json(const std::string& text, const OwnedProblem& problem);

/// Of a JSON file names_of_json() of its text; of an .nl file those of the .row and .col files beside it.
/// None of others. Errors: as names_of_json() has them, and of files that cannot be read.
[[nodiscard]] Expected<ProblemNames> names_of_file(const std::string& path, const OwnedProblem& problem);

/// A problem with its names.
struct NamedProblem {
  ProblemFile file;
  ProblemNames names;
};
/// formats::read_any_problem() and names_of_file(), of one text where the path is "-", standard input.
[[nodiscard]] Expected<NamedProblem> read_named_problem(const std::string& path);
/// The JSON text of a problem, as write_problem() writes it, with a key "names" where there are names. Bytes
/// that are not UTF-8, which an .nl file's names may hold, are replaced.
[[nodiscard]] std::string with_names(std::string problem, const ProblemNames& names);

}  // namespace marble::cli
