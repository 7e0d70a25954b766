// Formats a conflict for people: each part with its name and the numbers of its row.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "marble/report/conflict.h"
#include "output/json.h"
#include "output/problem_names.h"

namespace marble::cli {

/// A kind of parts: its name for one and for several, and their rows or pairs.
struct ConflictKind {
  const char* one;
  const char* several;
  std::vector<Index> Conflict::*indices;
};
/// The first four are the rows of a certificate, in its order.
inline constexpr std::array<ConflictKind, 5> kConflictKinds{
    {{"equality", "equalities", &Conflict::equalities},
     {"inequality", "inequalities", &Conflict::inequalities},
     {"left side", "left sides", &Conflict::left_sides},
     {"right side", "right sides", &Conflict::right_sides},
     {"complementarity", "complementarities", &Conflict::complementarities}}};

/// One part of a conflict.
struct ConflictLine {
  std::string kind;                  ///< of kConflictKinds, for one
  Index index = 0;                   ///< of its row or pair
  std::string name;                  ///< from the file, else "A[3]", "C[3]", "pair[3]"
  std::string text;                  ///< "x + 2 y = 4", "gap >= 0", "gap = 0 or force = 0"
  std::optional<double> relax = {};  ///< by how much to relax it so that the others have a common point
};

/// `certificate` is the solution's; it gives `relax` if the conflict needs no complementarity.
[[nodiscard]] std::vector<ConflictLine> conflict_lines(const OwnedProblem& problem, const ProblemNames& names,
                                                       const Conflict& conflict,
                                                       std::span<const double> certificate);

/// Returns several lines, the last one with a line break.
[[nodiscard]] std::string conflict_text(const Conflict& conflict, const std::vector<ConflictLine>& lines);

/// Returns {equalities, inequalities, left_sides, right_sides, complementarities, minimal, detail,
/// linear_programs, factorizations} and, if there are lines, parts: [{kind, index, name, text, relax}].
[[nodiscard]] Json conflict_json(const Conflict& conflict, const std::vector<ConflictLine>& lines);

}  // namespace marble::cli
