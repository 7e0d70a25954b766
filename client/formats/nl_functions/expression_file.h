// A nonlinear .nl file, checked and written again for AMPL's library: that one trusts what it reads, so it
// reads no file of anybody else's.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "nl/nl_model.h"
#include "nl/nl_tokens.h"

namespace marble::formats {

/// What was read, by the file's own rows and variables.
struct ExpressionFile {
  std::string content;  ///< binary: one objective to be minimised and all rows, without bounds
  NlHeader header;
  /// Long defined variables, by the file's number: variables after the file's, each with a row after the
  /// file's.
  std::vector<int> lifted;
  /// All but the expressions: after the variables there is one more for the value of each row.
  NlModel model;
};

/// Operators are AMPL's of numbers, but for those that jump: abs, min, max and if are fine. Errors name row
/// or variable. Memory is in proportion to the file's length (file_limits.h), that of second derivatives too.
[[nodiscard]] Expected<ExpressionFile> read_expressions(std::string_view content, const NlNames& names);

}  // namespace marble::formats
