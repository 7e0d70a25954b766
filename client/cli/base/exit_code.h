// Defines the program's exit codes for scripts.
#pragma once

#include <algorithm>

#include "marble/error.h"

namespace marble::cli {

enum ExitCode {
  kAllSolved = 0,
  kNotSolved = 1,    // at least one problem was not solved
  kBadInput = 2,     // wrong usage, or an invalid file or option
  kUnreachable = 3,  // the server cannot be reached, or refused
};

inline constexpr const char* kExitCodes =
    "Exit codes: 0 all solved, 1 some not solved, 2 usage or bad file, 3 server unreachable or refused;\n"
    "of several outcomes the highest.";

/// Returns the worse of two exit codes of one command.
[[nodiscard]] inline int worse(int a, int b) { return std::max(a, b); }

/// Returns the exit code of an error.
[[nodiscard]] inline int exit_code_of(const Error& error) {
  switch (error.code) {
#define MARBLE_ERROR(name, code, exit, ...) \
  case ErrorCode::name:                     \
    return exit;
#include "marble/contract.def"
  }
  return kUnreachable;
}

/// The same for an error that arose in this process: input that is too large is a bad file, not a server's
/// refusal.
[[nodiscard]] inline int exit_code_of_local(const Error& error) {
  return error.code == ErrorCode::resource_exhausted ? kBadInput : exit_code_of(error);
}

}  // namespace marble::cli
