// AMPL's .nl files, text or binary: those that are LCQPs.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "marble/problem_file.h"
#include "nl/nl_names.h"

namespace marble::formats {

/// A part of an LCQP that has multipliers of its own.
enum class Block { equality, inequality, left, right };

/// A dual value of the file is the sum of its terms: sign · the block's multiplier of this index.
struct DualTerm {
  Index of;  ///< row or variable of the file, from 0
  Block block;
  Index index;
  double sign;
};

/// An .nl file as an LCQP, and the way back to its own rows and variables.
struct NlProblem {
  ProblemFile file;  ///< its first variables are the file's; mixed complementarity adds some after them
  /// Of rows: change of the LCQP's objective by a row's right-hand side. Rows that bound nothing have none.
  std::vector<DualTerm> row_duals;
  /// Of variables: what their bounds and the pairs they are in contribute to the gradient (reduced costs).
  std::vector<DualTerm> reduced_costs;
  /// Dual values that the file begins with, by row, in AMPL's signs; empty without segment d.
  std::vector<double> initial_duals;
  /// Lowest and highest value of each variable, but for what pairs hold, where they were to be apart; else
  /// none.
  std::vector<std::pair<double, double>> bounds;

  /// What the LCQP's objective, bound and dual values are to be multiplied by to be the file's.
  [[nodiscard]] double sign() const { return file.maximize ? -1.0 : 1.0; }
};

/// A quadratic objective, linear constraints with bounds, linear complementarity conditions ("complements"),
/// no integers. Everything else is refused with the reason and the row's or variable's name. A maximum
/// becomes the minimum of the negative. A condition is with regard to those bounds of its variable that its
/// row names ("5 k i": k & 1 the lower, k & 2 the upper one); other bounds stay bounds. One with regard to
/// both takes two variables of its own, after the file's. What the file says of suffixes is left out; its
/// initial point is taken. Memory is in proportion to the file's length (file_limits.h).
[[nodiscard]] Expected<NlProblem> parse_nl_problem(std::string_view content, const std::string& name,
                                                   const NlNames& names = {});

/// Without the way back.
[[nodiscard]] Expected<ProblemFile> parse_nl(std::string_view content, const std::string& name,
                                             const NlNames& names = {});

}  // namespace marble::formats
