// What the program's exit tells a script.
#pragma once

#include <algorithm>

#include "marble/error.h"

namespace marble::cli {

enum ExitCode {
  kAllSolved = 0,
  kNotSolved = 1,    // at least one problem ended without being solved
  kBadInput = 2,     // usage, or a file or option that is wrong
  kUnreachable = 3,  // the server cannot be reached, or refused
};

/// The worse of two outcomes of one command.
[[nodiscard]] inline int worse(int a, int b) { return std::max(a, b); }

/// Which outcome an error is.
[[nodiscard]] inline int exit_code_of(const Error& error) {
  switch (error.code) {
    case ErrorCode::invalid_argument:
    case ErrorCode::not_found:
    case ErrorCode::failed_precondition:
      return kBadInput;
    case ErrorCode::cancelled:
    case ErrorCode::deadline_exceeded:
      return kNotSolved;
    default:
      return kUnreachable;
  }
}

}  // namespace marble::cli
