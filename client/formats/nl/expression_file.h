// Validates a nonlinear .nl file and writes it again for AMPL's library, which trusts its input and therefore
// never reads a user's file.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "nl/nl_model.h"
#include "nl/nl_tokens.h"

namespace marble::formats {

/// The content of the file, in terms of its own rows and variables.
struct ExpressionFile {
  std::string content;  ///< binary: one objective to minimize and all rows, without bounds
  NlHeader header;
  /// Long defined variables, by the file's number: variables after the file's, each with a row after the
  /// file's rows.
  std::vector<int> lifted;
  /// All but the expressions: after the variables it has one more for the value of each row.
  NlModel model;
};

/// Accepts AMPL's numeric operators, except those that jump: abs, min, max and if are allowed. Errors name
/// row or variable. Memory, including second derivatives, is proportional to the file's length
/// (file_bytes.h).
[[nodiscard]] Expected<ExpressionFile> read_expressions(std::string_view content, const NlNames& names);

}  // namespace marble::formats
