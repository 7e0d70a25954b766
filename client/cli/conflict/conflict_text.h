// A conflict as a person reads it: each part by its name, with the numbers of its row.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "conflict/problem_names.h"
#include "marble/report/conflict.h"
#include "output/json.h"

namespace marble::cli {

/// One part of a conflict.
struct ConflictLine {
  std::string kind;  ///< "equality", "inequality", "left side", "right side", "complementarity"
  Index index = 0;   ///< of its row or pair
  std::string name;  ///< the file's, else "A[3]", "C[3]", "pair[3]"
  std::string text;  ///< "x + 2 y = 4", "gap >= 0", "gap = 0 or force = 0"
  std::optional<double> relax = {};  ///< by how much less it must ask for so that the others have a point
};

/// `certificate`: of the solution; where the conflict needs no complementarity it says how far to relax.
[[nodiscard]] std::vector<ConflictLine> conflict_lines(const OwnedProblem& problem, const ProblemNames& names,
                                                       const Conflict& conflict,
                                                       std::span<const double> certificate);

/// Several lines, the last one with a line break.
[[nodiscard]] std::string conflict_text(const Conflict& conflict, const std::vector<ConflictLine>& lines);

/// {equalities, inequalities, left_sides, right_sides, complementarities, minimal, detail, linear_programs,
/// factorizations} and, where there are lines, parts: [{kind, index, name, text, relax}].
[[nodiscard]] Json conflict_json(const Conflict& conflict, const std::vector<ConflictLine>& lines);

}  // namespace marble::cli
