// Reads AMPL's .nl files, text or binary, that are LCQPs.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "marble/problem_file.h"
#include "nl/nl_names.h"

namespace marble::formats {

/// A part of an LCQP with its own multipliers.
enum class Block { equality, inequality, left, right };

/// A dual value of the file is the sum of its terms: sign · the block's multiplier of this index.
struct DualTerm {
  Index of;  ///< row or variable of the file, from 0
  Block block;
  Index index;
  double sign;
};

/// An .nl file as an LCQP, with the mapping back to its own rows and variables.
struct NlProblem {
  ProblemFile file;  ///< its first variables are the file's; mixed complementarity appends more
  /// For rows: change of the LCQP's objective per change of the right-hand side. Rows without bounds have
  /// none.
  std::vector<DualTerm> row_duals;
  /// For variables: the contribution of their bounds and pairs to the gradient (reduced costs).
  std::vector<DualTerm> reduced_costs;
  /// Initial dual values of the file, by row, with AMPL's signs; empty without segment d.
  std::vector<double> initial_duals;
  /// Lowest and highest value of each variable, except those that pairs impose, if requested separately; else
  /// empty.
  std::vector<std::pair<double, double>> bounds;

  /// Returns the factor from the LCQP's objective, bound and dual values to the file's.
  [[nodiscard]] double sign() const { return file.maximize ? -1.0 : 1.0; }
};

/// Reads a file with a quadratic objective, linear constraints with bounds, linear complementarity conditions
/// ("complements") and no integers. Anything else is rejected with the reason and the name of the row or
/// variable. A maximum becomes the minimum of the negative. A condition refers to the bounds of its variable
/// that its row names ("5 k i": k & 1 the lower, k & 2 the upper one); other bounds stay bounds. A condition
/// on both adds two variables after the file's. Suffixes are ignored; the initial point is used. Memory is
/// proportional to the file's length (file_bytes.h).
[[nodiscard]] Expected<NlProblem> parse_nl_problem(std::string_view content, const std::string& name,
                                                   const NlNames& names = {});

/// Without the mapping back.
[[nodiscard]] Expected<ProblemFile> parse_nl(std::string_view content, const std::string& name,
                                             const NlNames& names = {});

}  // namespace marble::formats
