// Errors are values: what was wrong, where, and the bound it broke.
#pragma once

#include <cstdint>
#include <new>
#include <string>
#include <string_view>
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

/// An error of no field: of a call, a connection, a file as a whole.
[[nodiscard]] Error failure(ErrorCode code, std::string bound);
/// An error of a field as a whole, with its value where that tells something.
[[nodiscard]] Error failure(ErrorCode code, std::string field, std::string value, std::string bound);
/// An error of a field as a whole.
[[nodiscard]] Error failure(ErrorCode code, std::string field, std::string bound);
/// A field that breaks a documented rule.
[[nodiscard]] Error invalid(std::string field, std::string bound);
/// A field that breaks a documented rule, with the value that does.
[[nodiscard]] Error invalid(std::string field, std::string value, std::string bound);
/// Entry `index` of a field, 0-based, that breaks a documented rule.
[[nodiscard]] Error invalid(std::string field, std::int64_t index, std::string value, std::string bound);
/// The error as whoever holds the thing under the name `prefix` tells it: "A.values" of "problem" becomes
/// "problem.A.values". One of no field stays as it is.
[[nodiscard]] Error inside(std::string_view prefix, Error error);
/// The error as one of `field`.
[[nodiscard]] Error of_field(std::string field, Error error);

/// resource_exhausted: there is no memory left.
[[nodiscard]] Error out_of_memory();
/// What `work` returns, an Expected; or the error, where memory runs out in it.
template <class Work>
[[nodiscard]] auto or_out_of_memory(const Work& work, Error (*error)() = out_of_memory) -> decltype(work()) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return unexpected(error());
  }
}

}  // namespace marble
