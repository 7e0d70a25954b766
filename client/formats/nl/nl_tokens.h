// Reads the tokens of an AMPL .nl file, text or binary: D. M. Gay, "Writing .nl Files" (2005).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "marble/error.h"

namespace marble::formats {

/// The relevant content of the ten header lines.
struct NlHeader {
  bool binary = false;
  std::vector<int> options = {};         ///< from the first line, for the solution to repeat
  std::optional<double> vb_tolerance{};  ///< after them if the second is 3; also to be repeated
  int variables = 0, constraints = 0, objectives = 0;
  std::int64_t integers = 0;                ///< integer and binary variables
  std::int64_t first_integer = 0;           ///< one of them; no column where the counts contradict each other
  std::int64_t networks = 0;                ///< network constraints
  int functions = 0;                        ///< imported functions
  std::int64_t jacobian = 0, gradient = 0;  ///< entries of the segments J, of the segments G
  int logical_constraints = 0;
};

/// Reads sequentially. After the first error every token is zero, and error() returns that error.
class NlTokens {
 public:
  explicit NlTokens(std::string_view content) : rest_(content) {}

  [[nodiscard]] NlHeader header();

  /// Returns the letter of the next segment or expression node; '\0' at the end.
  char key();
  /// Returns an integer in [low, high]. `what` names it in the error.
  int integer(const char* what, int low, int high);
  double real(const char* what);
  /// Returns an 's' or 'l' constant of a binary file: two or four bytes.
  double short_constant(char key);
  /// Skips the name of a suffix.
  void skip_name();

  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] const Error& error() const { return error_; }
  /// Remembers the first error; its value gives the position in the file.
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
