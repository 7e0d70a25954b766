// The tokens of an AMPL .nl file, text or binary: D. M. Gay, "Writing .nl Files" (2005).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "marble/error.h"

namespace marble::formats {

/// What the ten lines of the header say, as far as it matters here.
struct NlHeader {
  bool binary = false;
  std::vector<int> options = {};         ///< of the first line, for the solution to repeat
  std::optional<double> vb_tolerance{};  ///< after them where the second is 3, to be repeated too
  int variables = 0, constraints = 0, objectives = 0;
  std::int64_t integers = 0;                ///< integer and binary variables
  int first_integer = 0;                    ///< one of them, where there are any
  std::int64_t networks = 0;                ///< network constraints
  int functions = 0;                        ///< imported ones
  std::int64_t jacobian = 0, gradient = 0;  ///< entries of the segments J, of the segments G
  int logical_constraints = 0;
};

/// Reads on from where it is. After the first error every token is zero, and error() says what it was.
class NlTokens {
 public:
  explicit NlTokens(std::string_view content) : rest_(content) {}

  [[nodiscard]] NlHeader header();

  /// The letter of the next segment or expression node; '\0' at the end.
  char key();
  /// An integer in [low, high]. `what` names it in the error.
  int integer(const char* what, int low, int high);
  double real(const char* what);
  /// 's' and 'l' constants of binary files: two or four bytes.
  double short_constant(char key);
  /// Skips the name of a suffix.
  void skip_name();

  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] const Error& error() const { return error_; }
  /// Remembers the first fault; its value tells where in the file it is.
  void fail(const std::string& field, const std::string& value, const std::string& bound);

 private:
  [[nodiscard]] std::string_view line();
  void options_line(std::string_view words, NlHeader& header);
  [[nodiscard]] std::array<int, 6> header_line(int number, int least);
  [[nodiscard]] std::string_view word();
  template <class Number>
  [[nodiscard]] Number raw();

  std::string_view rest_;
  int line_ = 0;
  bool binary_ = false;
  bool failed_ = false;
  Error error_;
};

}  // namespace marble::formats
