// Errors are values: what was wrong, where, and the bound it broke.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>

namespace marble {

/// What kind of fault it is; what a caller may branch on. Listed, with what they mean, in contract.def.
enum class ErrorCode {
#define MARBLE_ERROR(name, ...) name,
#include "marble/contract.def"
};

/// Lower-case name of a code, as in logs and command-line output: "invalid_argument".
[[nodiscard]] const char* to_string(ErrorCode code);

/// What was wrong, where, and the rule it broke.
struct Error {
  ErrorCode code = ErrorCode::internal;  ///< the kind of fault
  std::string field;                     ///< path of the offending field, e.g. "A.row_indices"; empty if none
  std::int64_t index = -1;  ///< position in that field, 0-based; -1 if the field as a whole is meant
  std::string value;        ///< the offending value as text, e.g. "nan"; may be empty
  std::string bound;        ///< the rule that was broken, e.g. "must be < 12 (rows)"

  /// One line for people: "A.row_indices[3] = 12: must be in [0, 12)".
  [[nodiscard]] std::string message() const;
};

/// A value, or the error why there is none: `if (answer) use(*answer); else tell(answer.error());`
template <class T>
using Expected = tl::expected<T, Error>;
using tl::unexpected;

}  // namespace marble
