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

inline constexpr const char* kExitCodes =
    "Exit codes: 0 all solved, 1 some not solved, 2 usage or bad file, 3 server unreachable or refused;\n"
    "of several outcomes the highest.";

/// The worse of two outcomes of one command.
[[nodiscard]] inline int worse(int a, int b) { return std::max(a, b); }

/// Which outcome an error is.
[[nodiscard]] inline int exit_code_of(const Error& error) {
  switch (error.code) {
#define MARBLE_ERROR(name, code, exit, ...) \
  case ErrorCode::name:                     \
    return exit;
#include "marble/contract.def"
  }
  return kUnreachable;
}

/// The same of an error that arose in this process: what is too large for it is a bad file, and no server's
/// refusal.
[[nodiscard]] inline int exit_code_of_local(const Error& error) {
  return error.code == ErrorCode::resource_exhausted ? kBadInput : exit_code_of(error);
}

}  // namespace marble::cli
