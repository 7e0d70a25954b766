// Provides the problems of a scenario's entries.
#include <algorithm>

#include "formats.h"
#include "marble/examples.h"
#include "marble/macmpec.h"
#include "scenario.h"

namespace marble::load {
namespace {

template <class Parameters>
Parameters varied(int size, std::uint64_t seed) {
  Parameters parameters;
  if (size > 0) parameters.steps = size;
  return examples::vary(parameters, seed);
}

OwnedProblem example(const std::string& name, int size, std::uint64_t seed) {
  if (name == "hopper") return examples::hopper(varied<examples::HopperParameters>(size, seed));
  if (name == "rocket") return examples::rocket(varied<examples::RocketParameters>(size, seed));
  if (name == "gates") return examples::gates(varied<examples::GatesParameters>(size, seed));
  if (name == "jr1") return examples::find_macmpec("jr1")->problem();  // the cost of a nearly empty request
  examples::QpecParameters parameters;
  if (size > 0) {
    parameters.upper_variables = std::max(1, size / 5);
    parameters.lower_variables = size - parameters.upper_variables;
    parameters.degenerate_pairs = std::min<Index>(parameters.degenerate_pairs, parameters.lower_variables);
  }
  return examples::qpec(parameters, seed + 1);
}

bool same_pattern(const SparseMatrix& a, const SparseMatrix& b) {
  return a.rows == b.rows && a.column_pointers == b.column_pointers && a.row_indices == b.row_indices;
}

bool same_pattern(const OwnedProblem& a, const OwnedProblem& b) {
  return same_pattern(a.Q, b.Q) && same_pattern(a.A, b.A) && same_pattern(a.C, b.C) &&
         same_pattern(a.L, b.L) && same_pattern(a.R, b.R);
}

}  // namespace

const std::vector<std::string>& example_names() {
  static const std::vector<std::string> names = {"hopper", "rocket", "gates", "qpec", "jr1"};
  return names;
}

Expected<std::vector<OwnedProblem>> problems_of(const Entry& entry) {
  std::vector<OwnedProblem> result;
  if (!entry.file.empty()) {
    auto file = formats::read_any_problem(entry.file.string());
    if (!file) {
      Error error = file.error();
      error.field = entry.file.string() + (error.field.empty() ? "" : ": " + error.field);
      return unexpected(error);
    }
    result.push_back(std::move(file->problem));
  } else {
    if (entry.problem == "qpec" && entry.size == 1)
      return unexpected(invalid("size", "1", "must be at least 2 for qpec"));
    for (int k = 0; k < entry.variants; ++k)
      result.push_back(example(entry.problem, entry.size, static_cast<std::uint64_t>(k)));
  }
  for (const OwnedProblem& p : result) {
    MARBLE_RETURN_IF_ERROR(Problem::create(p.view()));
    if (!same_pattern(p, result.front()))
      return unexpected(invalid("variants", std::to_string(entry.variants),
                                "their matrices have not all the same pattern: fewer may have"));
  }
  return result;
}

}  // namespace marble::load
