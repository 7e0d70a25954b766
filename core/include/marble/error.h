// Errors as values: what was wrong, where, and the bound it violates.
#pragma once

#include <cstdint>
#include <new>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace marble {

/// The kind of an error, on which callers may branch. contract.def lists all kinds with their meanings.
enum class ErrorCode {
#define MARBLE_ERROR(name, ...) name,
#include "marble/contract.def"
};

/// Returns the code's name in lower case, as in logs and command-line output: "invalid_argument".
[[nodiscard]] const char* to_string(ErrorCode code);

/// What was wrong, where, and the rule it violates.
struct Error {
  ErrorCode code = ErrorCode::internal;  ///< the kind of error
  std::string field;                     ///< path of the offending field, e.g. "A.row_indices"; empty if none
  std::int64_t index = -1;  ///< position in that field, 0-based; -1 if the field as a whole is meant
  std::string value;        ///< the offending value as text, e.g. "nan"; may be empty
  std::string bound;        ///< the rule that was broken, e.g. "must be < 12 (rows)"

  /// Returns one line for users: "A.row_indices[3] = 12: must be in [0, 12)".
  [[nodiscard]] std::string message() const;
};

/// A value, or the error that explains why there is none: `if (answer) use(*answer); else
/// report(answer.error());`
template <class T>
using Expected = tl::expected<T, Error>;
using tl::unexpected;

/// `MARBLE_RETURN_IF_ERROR(expression);` returns from the caller with the error of the Expected that the
/// expression yields, if it has one, and otherwise drops its value. The caller returns an Expected or
/// `unexpected`.
#define MARBLE_RETURN_IF_ERROR(...)                                                              \
  do {                                                                                           \
    if (auto&& marble_result = __VA_ARGS__; !marble_result)                                      \
      return ::marble::unexpected(std::forward<decltype(marble_result)>(marble_result).error()); \
  } while (false)

/// `MARBLE_ASSIGN_OR_RETURN(declaration, expression);` returns from the caller with the expression's error if
/// there is one, and otherwise initializes what is declared with the value: `MARBLE_ASSIGN_OR_RETURN(const
/// auto problem, read(path));`. The value of a temporary is moved, that of a variable copied; after std::move
/// it is moved. These are several statements: in a body of if or for, use braces.
#define MARBLE_ASSIGN_OR_RETURN(declaration, ...) \
  MARBLE_ASSIGN_OR_RETURN_AS_(MARBLE_CONCATENATE_(marble_result_, __LINE__), declaration, __VA_ARGS__)
#define MARBLE_ASSIGN_OR_RETURN_AS_(result, declaration, ...)                               \
  auto&& result = __VA_ARGS__;                                                              \
  if (!result) return ::marble::unexpected(std::forward<decltype(result)>(result).error()); \
  declaration = *std::forward<decltype(result)>(result)
#define MARBLE_CONCATENATE_(left, right) MARBLE_JOIN_(left, right)
#define MARBLE_JOIN_(left, right) left##right

/// Returns an error without a field: of a call, a connection, a whole file.
[[nodiscard]] Error failure(ErrorCode code, std::string bound);
/// Returns an error of a whole field, with its value where that is informative.
[[nodiscard]] Error failure(ErrorCode code, std::string field, std::string value, std::string bound);
/// Returns an error of a whole field.
[[nodiscard]] Error failure(ErrorCode code, std::string field, std::string bound);
/// Returns the error of a field that violates a documented rule.
[[nodiscard]] Error invalid(std::string field, std::string bound);
/// Returns the error of a field that violates a documented rule, with the value that violates it.
[[nodiscard]] Error invalid(std::string field, std::string value, std::string bound);
/// Returns the error of entry `index` (0-based) of a field that violates a documented rule.
[[nodiscard]] Error invalid(std::string field, std::int64_t index, std::string value, std::string bound);
/// Returns the error with its field inside `prefix`: "A.values" in "problem" becomes "problem.A.values". An
/// error without a field stays as it is.
[[nodiscard]] Error inside(std::string_view prefix, Error error);
/// Returns the error with the field `field`.
[[nodiscard]] Error of_field(std::string field, Error error);

/// resource_exhausted: out of memory.
[[nodiscard]] Error out_of_memory();
/// Returns the result of `work`, an Expected, or `error()` if it runs out of memory.
template <class Work>
[[nodiscard]] auto or_out_of_memory(const Work& work, Error (*error)() = out_of_memory) -> decltype(work()) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return unexpected(error());
  }
}

}  // namespace marble
